// Lloyd's method, with a hash grid of the clusters' middles.
//
// A round assigns each point to the nearest middle, which makes the clusters Voronoi cells, and
// then moves each middle to the mean of its points. Both steps lower the sum of squared distances,
// so the rounds converge, to cells that are nearly hexagons (Lloyd 1982; Du, Faber and Gunzburger
// 1999):
//
//     equal stretches            after some rounds
//     +----+--+-----+            /  \ /  \ /  \          Steps of 1.7 times the way to the mean
//     | x  |x | x   |    --->   |  x |  x |  x |         reach the same evenness in half as many
//     +--+-+--+--+--+            \  / \  / \  /          rounds; the last round takes 1.
//
// The nearest middle of every point is the inner loop. Three things make it fast:
//
// - Middles lie in a grid whose cells are as wide as clusters are apart, so that the nearest one is
//   in the point's cell or one of its 26 neighbours. Where the spacing varies there is a grid for
//   each power of two of it.
// - Points are visited cell by cell, so the middles around a cell are gathered once, in columns
//   (NearClusters), and a loop without branches finds the nearest.
// - The loop finds the least distance and its row in one number:
//
//       31                       7 6        0
//       [ square of the distance | row       ]    floats that are not negative are ordered as their
//         upper 25 bits            0 to 127       bits are, so one integer minimum finds both
#include "engine/scene/sampling/clusters.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"

namespace ptc {
namespace {

// Cosine between a point's normal and its cluster's, at least: surfaces that turn by more than 75
// degrees do not share a cluster.
constexpr float kMinCosine = 0.26f;

// How far a cluster moves towards the middle of its members, over the distance to it. Overshooting
// takes half as many rounds to the same evenness.
constexpr float kStride = 1.7f;

// The bounding box of the points, which the grids lie on.
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

// The clusters near one cell of a grid, in columns that a loop without branches goes through.
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

  // Finds the nearest cluster that p may join.
  // @param best   squared distance of the owner so far; is lowered with it
  // @param owner  is replaced when the cluster is nearer than that
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
  static constexpr float kNever = 1e36f;  // finite, and greater than every squared distance
  using Column = std::array<float, kRows>;

  struct Table {
    Column x, y, z, normal_x, normal_y, normal_z, kind;

    // Returns the least squared distance, its lowest 7 bits replaced by the row. A cluster that p
    // may not join is put at a distance beyond all others instead of being skipped.
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

// Finds clusters by the cell that they lie in. The cells of a level are as wide as its clusters are
// apart; each level's cells are half as wide as those of the level before.
class ClusterGrid {
 public:
  static constexpr std::size_t kLevels = 8;

  ClusterGrid(const Box& box, float widest_cell) : low_(box.low) {
    // Keep cell indices within 19 bits on each axis. A patch that is wider than that many cells is
    // sparse, and larger cells serve it as well.
    const float least = box.widest / 524000;
    for (std::size_t level = 0; level < kLevels; ++level) {
      cell_[level] = std::max({std::ldexp(widest_cell, -static_cast<int>(level)), least,
                               std::numeric_limits<float>::min()});
    }
  }

  // Returns the finest level whose cells are at least `reach` wide.
  [[nodiscard]] std::size_t level_of(float reach) const {
    std::size_t level = 0;
    while (level + 1 < kLevels && cell_[level + 1] >= reach) ++level;
    return level;
  }

  // Replaces the contents by these clusters. @param levels  the level of each
  void rebuild(std::span<const Cluster> clusters, std::span<const std::size_t> levels) {
    // Sort the clusters by cell.
    entries_.clear();
    used_.clear();
    for (std::uint32_t i = 0; i < clusters.size(); ++i) {
      entries_.push_back({key_of(levels[i], cell_at(clusters[i].position, levels[i])), i});
    }
    std::sort(entries_.begin(), entries_.end());
    // Note which levels have clusters.
    for (std::size_t level = 0; level < kLevels; ++level) {
      if (std::find(levels.begin(), levels.end(), level) != levels.end()) used_.push_back(level);
    }
    // Hash the first cluster of each cell.
    table_.assign(std::bit_ceil(2 * entries_.size() + 1), kEmpty);
    for (std::uint32_t i = 0; i < entries_.size(); ++i) {
      if (i == 0 || entries_[i].first != entries_[i - 1].first) *slot(entries_[i].first) = i;
    }
  }

  // Returns the levels that have clusters.
  [[nodiscard]] std::span<const std::size_t> used_levels() const { return used_; }

  [[nodiscard]] std::uint64_t cell_key(std::size_t level, const glm::vec3& p) const {
    return key_of(level, cell_at(p, level));
  }

  // Calls visit(cluster) for each cluster in the cell around `p` and in its 26 neighbours.
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

  // Counts cells from 1 on, so that a neighbour before the first cell is no special case.
  [[nodiscard]] Cell cell_at(const glm::vec3& p, std::size_t level) const {
    const glm::vec3 at = (p - low_) / cell_[level];
    const auto index = [](float c) { return static_cast<std::uint64_t>(std::max(c, 0.0f)) + 1; };
    return {index(at.x), index(at.y), index(at.z)};
  }

  // Packs a cell into a number: level in 4 bits, then z, y and x in 20 bits each.
  static std::uint64_t key_of(std::size_t level, const Cell& c) {
    return std::uint64_t{level} << 60 | c[2] << 40 | c[1] << 20 | c[0];
  }

  // Returns the slot of a cell by linear probing: that with its first entry, or the empty one where
  // it would go.
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
  std::array<float, kLevels> cell_{};  // width of the cells of each level
  std::vector<std::size_t> used_;      // levels that have clusters
  std::vector<std::pair<std::uint64_t, std::uint32_t>> entries_;  // cell and cluster, sorted
  std::vector<std::uint32_t> table_;  // open addressing: index of the first entry of each cell
};

// The state of one run of the method.
class Lloyd {
 public:
  Lloyd(std::span<const SurfacePoint> points, std::size_t count, std::vector<std::uint32_t>& owners)
      : points_(points), owners_(owners), box_(points), clusters_(count), grid_(begin(count)) {
    sort_by_cell();
  }

  // Assigns the points, and moves the clusters.
  // @param stride  how far to go towards the members' middle; 1 goes all the way
  void round(float stride) {
    grid_.rebuild(clusters_, levels_);
    cached_cell_.fill(~std::uint64_t{0});
    for (const std::uint32_t i : order_) join_nearest(i);
    move_to_middles(stride);
    split_largest();
  }

  // Drops the clusters without members, and numbers the owners of all points accordingly.
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
  // Makes equal stretches of the points the first clusters. The largest of them sets the width of
  // the grids' cells.
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

  // Orders the points by cell. The cells stay while clusters move, and points that follow each
  // other in one cell share its list of clusters.
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

  // Moves each cluster by `stride` of the way to the middle of its members, and turns it to their
  // mean normal, or to that of any member where the normals cancel out.
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

  // Moves clusters that lost all members to members of the largest clusters, whose points the next
  // round divides.
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

  // Gives a point to the nearest cluster of its kind that faces its way. Where there is none among
  // the cells around it, its owner stays.
  void join_nearest(std::uint32_t i) {
    const SurfacePoint& p = points_[i];
    float best = 1e30f;
    for (const std::size_t level : grid_.used_levels()) {
      near(level, p.position).find_nearest(p, best, owners_[i]);
    }
  }

  // Returns the clusters of a level around a point, from the cache while the cell is the same.
  const NearClusters& near(std::size_t level, const glm::vec3& p) {
    const std::uint64_t cell = grid_.cell_key(level, p);
    if (cell != cached_cell_[level]) {
      cached_cell_[level] = cell;
      cached_[level].clear();
      grid_.near(level, p, [&](std::uint32_t c) { cached_[level].add(c, clusters_[c]); });
    }
    return cached_[level];
  }

  // Sums over the members of a cluster.
  struct Sum {
    glm::dvec3 position{0};
    glm::vec3 normal{0};
    std::uint32_t count = 0;
    std::uint32_t any = 0;  // index of one of the members
  };

  std::span<const SurfacePoint> points_;
  std::vector<std::uint32_t>& owners_;
  Box box_;
  std::vector<std::uint32_t> order_;  // indices of the points, by cell
  std::vector<Cluster> clusters_;
  std::vector<std::size_t> levels_;  // of the grid, for each cluster
  std::vector<Sum> sums_;
  std::array<std::uint64_t, ClusterGrid::kLevels> cached_cell_{};  // key of the cell, by level
  std::array<NearClusters, ClusterGrid::kLevels> cached_;          // the clusters around it
  ClusterGrid grid_;  // last, because begin() fills the members above
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
