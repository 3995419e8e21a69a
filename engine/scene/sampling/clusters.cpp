// Lloyd's method with a hash grid of the clusters' middles.
#include "engine/scene/sampling/clusters.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/scene/sampling/low_discrepancy.h"

namespace ptc {
namespace {

// Surfaces that turn by more than 75 degrees do not share a cluster.
constexpr float kMinCosine = 0.26f;

// Going beyond the middle takes half as many rounds to the same evenness.
constexpr float kStride = 1.7f;

// The points' bounding box, to put cells on it.
struct Box {
  glm::vec3 low;
  float widest;

  explicit Box(std::span<const SurfacePoint> points) : low(points.front().position) {
    glm::vec3 high = low;
    for (const SurfacePoint& p : points) {
      low = glm::min(low, p.position);
      high = glm::max(high, p.position);
    }
    const glm::vec3 extent = high - low;
    widest = std::max({extent.x, extent.y, extent.z});
  }
};

// Clusters near a cell, as columns that a loop without branches goes through.
class NearClusters {
 public:
  void clear() {
    size_ = 0;
    indices_.clear();
  }

  void add(std::uint32_t index, const Cluster& cluster) {
    if (size_ % kRows == 0 && size_ / kRows == tables_.size()) tables_.emplace_back();
    Table& table = tables_[size_ / kRows];
    const std::size_t row = size_++ % kRows;
    indices_.push_back(index);
    table.x[row] = cluster.position.x;
    table.y[row] = cluster.position.y;
    table.z[row] = cluster.position.z;
    table.normal_x[row] = cluster.normal.x;
    table.normal_y[row] = cluster.normal.y;
    table.normal_z[row] = cluster.normal.z;
    table.kind[row] = static_cast<float>(cluster.kind);
  }

  // Makes `owner` the nearest that p may join, if the square of its distance is below `best`.
  void find_nearest(const SurfacePoint& p, float& best, std::uint32_t& owner) const {
    for (std::size_t first = 0; first < size_; first += kRows) {
      const std::int32_t least = tables_[first / kRows].least(p, std::min(size_ - first, kRows));
      const auto square = std::bit_cast<float>(least);
      if (square >= best) continue;
      best = square;
      owner = indices_[first + static_cast<std::size_t>(least & kRowMask)];
    }
  }

 private:
  static constexpr std::size_t kRows = 128;
  static constexpr std::int32_t kRowMask = 127;
  static constexpr float kNever = 1e36f;  // beyond all squares, and no infinity
  using Column = std::array<float, kRows>;

  struct Table {
    Column x, y, z, normal_x, normal_y, normal_z, kind;

    // The least square of a distance, its last 7 bits replaced by the row: positive floats are
    // ordered as their bits are.
    [[nodiscard]] std::int32_t least(const SurfacePoint& p, std::size_t rows) const {
      const auto own_kind = static_cast<float>(p.kind);
      std::int32_t least = std::numeric_limits<std::int32_t>::max();
      for (std::int32_t i = 0; i < static_cast<std::int32_t>(rows); ++i) {
        const auto at = static_cast<std::size_t>(i);
        const float dx = x[at] - p.position.x;
        const float dy = y[at] - p.position.y;
        const float dz = z[at] - p.position.z;
        const float cosine =
            normal_x[at] * p.normal.x + normal_y[at] * p.normal.y + normal_z[at] * p.normal.z;
        const float off_kind = kind[at] - own_kind;
        const float square = dx * dx + dy * dy + dz * dz +
                             std::max(kMinCosine - cosine, 0.0f) * kNever +
                             off_kind * off_kind * kNever;
        const std::int32_t bits = std::bit_cast<std::int32_t>(square);
        least = std::min(least, (bits & ~kRowMask) | i);
      }
      return least;
    }
  };

  std::vector<Table> tables_;
  std::size_t size_ = 0;
  std::vector<std::uint32_t> indices_;
};

// Clusters by the cell they lie in. Cells are as wide as the clusters are apart; where that
// differs, there is a grid for each power of two of it.
class ClusterGrid {
 public:
  static constexpr std::size_t kLevels = 8;

  ClusterGrid(const Box& box, float widest_cell) : low_(box.low) {
    // 19 bits an axis: a patch that is wider than so many cells is sparse, and larger cells do.
    const float least = box.widest / 524000;
    for (std::size_t level = 0; level < kLevels; ++level) {
      cell_[level] = std::max({std::ldexp(widest_cell, -static_cast<int>(level)), least,
                               std::numeric_limits<float>::min()});
    }
  }

  // The grid for clusters that are `reach` apart.
  [[nodiscard]] std::size_t level_of(float reach) const {
    std::size_t level = 0;
    while (level + 1 < kLevels && cell_[level + 1] >= reach) ++level;
    return level;
  }

  void rebuild(std::span<const Cluster> clusters, std::span<const std::size_t> levels) {
    entries_.clear();
    used_.clear();
    for (std::uint32_t i = 0; i < clusters.size(); ++i) {
      entries_.push_back({key_of(levels[i], cell_at(clusters[i].position, levels[i])), i});
    }
    std::sort(entries_.begin(), entries_.end());
    for (std::size_t level = 0; level < kLevels; ++level) {
      if (std::find(levels.begin(), levels.end(), level) != levels.end()) used_.push_back(level);
    }
    table_.assign(std::bit_ceil(2 * entries_.size() + 1), kEmpty);
    for (std::uint32_t i = 0; i < entries_.size(); ++i) {
      if (i == 0 || entries_[i].first != entries_[i - 1].first) *slot(entries_[i].first) = i;
    }
  }

  // Those that have clusters.
  [[nodiscard]] std::span<const std::size_t> used_levels() const { return used_; }

  [[nodiscard]] std::uint64_t cell_key(std::size_t level, const glm::vec3& p) const {
    return key_of(level, cell_at(p, level));
  }

  // Calls visit(cluster) for those in the cell around `p` and its 26 neighbours.
  template <typename Visit>
  void near(std::size_t level, const glm::vec3& p, const Visit& visit) {
    const Cell middle = cell_at(p, level);
    for (std::uint64_t z = middle[2] - 1; z <= middle[2] + 1; ++z) {
      for (std::uint64_t y = middle[1] - 1; y <= middle[1] + 1; ++y) {
        for (std::uint64_t x = middle[0] - 1; x <= middle[0] + 1; ++x) {
          visit_cell({x, y, z}, level, visit);
        }
      }
    }
  }

 private:
  using Cell = std::array<std::uint64_t, 3>;
  static constexpr std::uint32_t kEmpty = ~0u;

  // From 1 on, so that a neighbour before the first is no special case.
  [[nodiscard]] Cell cell_at(const glm::vec3& p, std::size_t level) const {
    const glm::vec3 at = (p - low_) / cell_[level];
    const auto index = [](float c) { return static_cast<std::uint64_t>(std::max(c, 0.0f)) + 1; };
    return {index(at.x), index(at.y), index(at.z)};
  }

  static std::uint64_t key_of(std::size_t level, const Cell& c) {
    return std::uint64_t{level} << 60 | c[2] << 40 | c[1] << 20 | c[0];
  }

  std::uint32_t* slot(std::uint64_t key) {
    std::size_t i = splitmix64(key) & (table_.size() - 1);
    while (table_[i] != kEmpty && entries_[table_[i]].first != key) {
      i = (i + 1) & (table_.size() - 1);
    }
    return &table_[i];
  }

  template <typename Visit>
  void visit_cell(const Cell& cell, std::size_t level, const Visit& visit) {
    const std::uint64_t key = key_of(level, cell);
    for (std::size_t i = *slot(key); i < entries_.size() && entries_[i].first == key; ++i) {
      visit(entries_[i].second);
    }
  }

  glm::vec3 low_;
  std::array<float, kLevels> cell_{};
  std::vector<std::size_t> used_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> entries_;  // cell and cluster, sorted
  std::vector<std::uint32_t> table_;  // open addressing: the first entry of each cell
};

class Lloyd {
 public:
  Lloyd(std::span<const SurfacePoint> points, std::size_t count, std::vector<std::uint32_t>& owners)
      : points_(points), owners_(owners), box_(points), clusters_(count), grid_(begin(count)) {
    sort_by_cell();
  }

  // @param stride  how far to go towards the members' middle, 1: all the way
  void round(float stride) {
    grid_.rebuild(clusters_, levels_);
    cached_cell_.fill(~std::uint64_t{0});
    for (const std::uint32_t i : order_) join_nearest(i);
    move_to_middles(stride);
    split_largest();
  }

  std::vector<Cluster> finish() {
    std::vector<std::uint32_t> members(clusters_.size());
    for (const std::uint32_t owner : owners_) ++members[owner];
    std::vector<std::uint32_t> place(clusters_.size());
    std::vector<Cluster> kept;
    for (std::size_t c = 0; c < clusters_.size(); ++c) {
      place[c] = static_cast<std::uint32_t>(kept.size());
      if (members[c] > 0) kept.push_back(clusters_[c]);
    }
    for (std::uint32_t& owner : owners_) owner = place[owner];
    return kept;
  }

 private:
  // Equal stretches; the widest of them sets the grids.
  ClusterGrid begin(std::size_t count) {
    owners_.resize(points_.size());
    std::vector<double> area(count);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const std::size_t c = i * count / points_.size();
      owners_[i] = static_cast<std::uint32_t>(c);
      area[c] += points_[i].area;
      clusters_[c].kind = points_[i].kind;
    }
    move_to_middles(1);
    const auto reach = [](double a) { return static_cast<float>(std::sqrt(a)); };
    ClusterGrid grid(box_, reach(*std::max_element(area.begin(), area.end())));
    for (const double a : area) levels_.push_back(grid.level_of(0.9f * reach(a)));
    return grid;
  }

  // The cells stay while clusters move: points of a cell one after another share its list.
  void sort_by_cell() {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed(points_.size());
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      keyed[i] = {grid_.cell_key(levels_[owners_[i]], points_[i].position), i};
    }
    std::sort(keyed.begin(), keyed.end());
    order_.resize(keyed.size());
    std::transform(keyed.begin(), keyed.end(), order_.begin(),
                   [](const auto& k) { return k.second; });
  }

  void move_to_middles(float stride) {
    sums_.assign(clusters_.size(), {});
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Sum& sum = sums_[owners_[i]];
      sum.position += glm::dvec3(points_[i].position);
      sum.normal += points_[i].normal;
      sum.count += 1;
      sum.any = static_cast<std::uint32_t>(i);
    }
    for (std::size_t c = 0; c < clusters_.size(); ++c) {
      if (sums_[c].count == 0) continue;
      const glm::vec3 middle(sums_[c].position / static_cast<double>(sums_[c].count));
      clusters_[c].position = glm::mix(clusters_[c].position, middle, stride);
      const float length = glm::length(sums_[c].normal);
      clusters_[c].normal =
          length > 1e-3f ? sums_[c].normal / length : points_[sums_[c].any].normal;
    }
  }

  // Clusters that lost all members go to the largest, where the next round shares out its points.
  void split_largest() {
    std::vector<std::uint32_t> lost, largest;
    for (std::uint32_t c = 0; c < clusters_.size(); ++c) {
      if (sums_[c].count == 0) lost.push_back(c);
      if (sums_[c].count > 1) largest.push_back(c);
    }
    const std::size_t count = std::min(lost.size(), largest.size());
    std::partial_sort(largest.begin(), largest.begin() + static_cast<std::ptrdiff_t>(count),
                      largest.end(), [&](std::uint32_t a, std::uint32_t b) {
                        return std::pair(sums_[b].count, a) < std::pair(sums_[a].count, b);
                      });
    for (std::size_t i = 0; i < count; ++i) {
      const SurfacePoint& p = points_[sums_[largest[i]].any];
      clusters_[lost[i]] = {p.position, p.normal, p.kind};
      levels_[lost[i]] = levels_[largest[i]];
    }
  }

  // Leaves the point where it is when no cluster near it faces its way.
  void join_nearest(std::uint32_t i) {
    const SurfacePoint& p = points_[i];
    float best = 1e30f;
    for (const std::size_t level : grid_.used_levels()) {
      near(level, p.position).find_nearest(p, best, owners_[i]);
    }
  }

  const NearClusters& near(std::size_t level, const glm::vec3& p) {
    const std::uint64_t cell = grid_.cell_key(level, p);
    if (cell != cached_cell_[level]) {
      cached_cell_[level] = cell;
      cached_[level].clear();
      grid_.near(level, p, [&](std::uint32_t c) { cached_[level].add(c, clusters_[c]); });
    }
    return cached_[level];
  }

  struct Sum {
    glm::dvec3 position{0};
    glm::vec3 normal{0};
    std::uint32_t count = 0;
    std::uint32_t any = 0;  // one of the members
  };

  std::span<const SurfacePoint> points_;
  std::vector<std::uint32_t>& owners_;
  Box box_;
  std::vector<std::uint32_t> order_;  // of the points, by cell
  std::vector<Cluster> clusters_;
  std::vector<std::size_t> levels_;
  std::vector<Sum> sums_;
  std::array<std::uint64_t, ClusterGrid::kLevels> cached_cell_{};
  std::array<NearClusters, ClusterGrid::kLevels> cached_;
  ClusterGrid grid_;  // last: begin() fills what is above
};

}  // namespace

std::vector<Cluster> cluster_points(std::span<const SurfacePoint> points, std::size_t count,
                                    unsigned rounds, std::vector<std::uint32_t>& owners) {
  owners.clear();
  if (points.empty() || count == 0) return {};
  Lloyd lloyd(points, std::min(count, points.size()), owners);
  for (unsigned i = 1; i < rounds; ++i) lloyd.round(kStride);
  if (rounds > 0) lloyd.round(1);
  return lloyd.finish();
}

}  // namespace ptc
