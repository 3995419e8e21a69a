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
// The first rounds look at a few points of each cluster, which tell about as well where its middle
// goes; the last two look at all, which measure it.
//
// The nearest middle of every point is the inner loop. Three things make it fast:
//
// - Points lie in cells as wide as clusters are apart (point_cells.h): the nearest middle is in the
//   point's cell or one around it. Cells and their neighbours stay; middles move among them.
// - Points are visited cell by cell, so the middles around a cell are gathered once, in columns
//   (near_clusters.h), and a loop without branches finds the nearest.
// - The loop finds the least distance and its row in one number:
//
//       31                       8 7        0
//       [ square of the distance | row       ]    floats that are not negative are ordered as their
//         upper 24 bits            0 to 255       bits are, so one integer minimum finds both
#include "engine/scene/sampling/clusters.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "engine/base/basis.h"
#include "engine/base/numbers.h"
#include "engine/scene/sampling/near_clusters.h"
#include "engine/scene/sampling/point_cells.h"
#include "format/instruction_sets.h"

namespace ptc {
namespace {

// How far a cluster moves towards the middle of its members, over the distance to it. Overshooting
// takes half as many rounds to the same evenness.
constexpr float kStride = 1.7f;

// A cluster is enclosed when in each direction of its plane, give or take 60 degrees, there is
// another that is at most kNextTo of its own width away, no farther above or below than kSteepness
// of that way, and turned by 45 degrees at most.
constexpr std::size_t kDirections = 16;
constexpr float kWithinTurn = 0.5F;  // cosine of 60 degrees
constexpr float kNextTo = 1.45F;
constexpr float kSteepness = 0.7F;
constexpr float kSameWay = 0.7F;  // cosine of 45 degrees

// Points of a cluster that a round looks at, about, and how many rounds at the end look at all.
constexpr std::size_t kEarlyPoints = 8;
constexpr unsigned kFullRounds = 2;

// Says whether clusters lie around one in all directions of its plane, within a distance.
bool is_enclosed(const Cluster& cluster, std::span<const Cluster> near, float distance) {
  static const auto kTurns = [] {
    std::array<glm::vec2, kDirections> turns{};
    for (std::size_t k = 0; k < kDirections; ++k) {
      const float turn = 2 * kPi * static_cast<float>(k) / kDirections;
      turns[k] = {std::cos(turn), std::sin(turn)};
    }
    return turns;
  }();
  const Basis frame(cluster.normal);
  std::array<float, kDirections> most{};  // cosine to the nearest neighbour's direction
  for (const Cluster& other : near) {
    const glm::vec3 offset = other.position - cluster.position;
    const float square = glm::dot(offset, offset);
    if (square > distance * distance || square == 0) continue;
    const float height = glm::dot(offset, cluster.normal);
    const glm::vec2 flat(glm::dot(offset, frame.x), glm::dot(offset, frame.y));
    const float across = glm::length(flat);
    if (std::abs(height) > kSteepness * across || other.kind != cluster.kind ||
        glm::dot(other.normal, cluster.normal) < kSameWay)
      continue;
    for (std::size_t k = 0; k < kDirections; ++k)
      most[k] = std::max(most[k], glm::dot(kTurns[k], flat) / across);
  }
  return std::ranges::all_of(most, [](float cosine) { return cosine >= kWithinTurn; });
}

// The state of one run of the method.
class Lloyd {
 public:
  Lloyd(std::span<const SurfacePoint> points, std::size_t count, std::vector<std::uint32_t>& owners)
      : points_(points), owners_(owners), clusters_(count), sums_(count), cells_(begin(count)) {
    levels_.reserve(count);
    for (const Sum& sum : sums_) levels_.push_back(cells_.level_of(cells_.of_point(sum.any)));
  }

  // Assigns points, and moves the clusters.
  // @param stride  how far to go towards the members' middle; 1 goes all the way
  // @param step    looks at every so many points
  void round(float stride, std::size_t step) {
    sort_points(step);
    sort_clusters();
    sums_.assign(clusters_.size(), {});
    with_instructions(widest_instructions(), [this] { join_nearest(); });
    move_to_middles(stride);
    split_largest();
  }

  // Finds the enclosed clusters, drops those without members, and numbers the owners of all points
  // accordingly.
  std::vector<Cluster> finish() {
    for (std::size_t k = 0; k < order_.size(); ++k) owners_[order_[k]] = members_[k].owner;
    mark_enclosed();
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
  // Makes equal stretches of the points the first clusters, and cells for their reach.
  PointCells begin(std::size_t count) {
    owners_.resize(points_.size());
    std::vector<double> area(count);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const std::size_t c = i * count / points_.size();
      owners_[i] = static_cast<std::uint32_t>(c);
      area[c] += points_[i].area;
      clusters_[c].kind = points_[i].kind;
      sums_[c].add(points_[i].position, points_[i].normal, i);
    }
    move_to_middles(1);
    std::vector<float> reach(count);
    std::transform(area.begin(), area.end(), reach.begin(),
                   [](double a) { return static_cast<float>(std::sqrt(a)); });
    return {points_, owners_, reach};
  }

  // Orders every `step`-th point by cell.
  void sort_points(std::size_t step) {
    if (step == step_) return;
    step_ = step;
    order_ = sort_by_cell((points_.size() + step - 1) / step, first_point_,
                          [&](std::size_t i) { return cells_.of_point(i * step); });
    members_.clear();
    for (std::uint32_t& i : order_) {
      i *= static_cast<std::uint32_t>(step);
      const SurfacePoint& p = points_[i];
      members_.push_back({{p.position, p.normal, static_cast<float>(p.kind)}, owners_[i]});
    }
  }

  // Orders the clusters by cell: that of a member where no point lies in the middle's own.
  void sort_clusters() {
    clusters_in_ = sort_by_cell(clusters_.size(), first_cluster_, [&](std::size_t c) {
      const std::uint32_t cell = cells_.find(levels_[c], clusters_[c].position);
      return cell != PointCells::kNone ? cell : cells_.of_point(sums_[c].any);
    });
    columns_.clear();
    for (const std::uint32_t c : clusters_in_) columns_.add(c, clusters_[c]);
  }

  // Returns the numbers from 0 to `count` by cell, ascending within one.
  // @param first  is overwritten with the index of the first number of each cell, then of the end
  template <typename CellOf>
  std::vector<std::uint32_t> sort_by_cell(std::size_t count, std::vector<std::uint32_t>& first,
                                          const CellOf& cell_of) {
    std::vector<std::uint32_t> cell(count), sorted(count);
    first.assign(cells_.size() + 1, 0);
    for (std::size_t i = 0; i < count; ++i) {
      cell[i] = cell_of(i);
      ++first[cell[i]];
    }
    std::exclusive_scan(first.begin(), first.end(), first.begin(), 0U);
    for (std::size_t i = 0; i < count; ++i)
      sorted[first[cell[i]]++] = static_cast<std::uint32_t>(i);
    std::shift_right(first.begin(), first.end(), 1);
    first.front() = 0;
    return sorted;
  }

  // Moves each cluster by `stride` of the way to the middle of its members, and turns it to their
  // mean normal, or to that of any member where the normals cancel out.
  void move_to_middles(float stride) {
    for (std::size_t c = 0; c < clusters_.size(); ++c) {
      if (sums_[c].count == 0) continue;
      const glm::vec3 middle(sums_[c].position / static_cast<double>(sums_[c].count));
      clusters_[c].position = glm::mix(clusters_[c].position, middle, stride);
      const float length = glm::length(sums_[c].normal);
      clusters_[c].normal =
          length > 1e-3f ? sums_[c].normal / length : points_[sums_[c].any].normal;
    }
  }

  // Marks the clusters that have others around them.
  void mark_enclosed() {
    std::vector<double> area(clusters_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) area[owners_[i]] += points_[i].area;
    sort_clusters();
    std::vector<Cluster> near;
    for (std::uint32_t cell = 0; cell < cells_.size(); ++cell) {
      if (first_cluster_[cell] == first_cluster_[cell + 1]) continue;
      near.clear();
      for (const auto [first, end] : cells_.around(cell)) {
        for (std::uint32_t k = first_cluster_[first]; k < first_cluster_[end]; ++k)
          if (area[clusters_in_[k]] > 0) near.push_back(clusters_[clusters_in_[k]]);
      }
      for (std::uint32_t k = first_cluster_[cell]; k < first_cluster_[cell + 1]; ++k) {
        Cluster& cluster = clusters_[clusters_in_[k]];
        const double width = std::sqrt(area[clusters_in_[k]]);
        cluster.is_enclosed = is_enclosed(cluster, near, kNextTo * static_cast<float>(width));
      }
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
      sums_[lost[i]].any = sums_[largest[i]].any;
    }
  }

  // Gives the points to the nearest clusters of their kind that face their way, and sums up the
  // members. Where there is none among the cells around a point, its owner stays.
  void join_nearest() {
    for (std::uint32_t cell = 0; cell < cells_.size(); ++cell) {
      if (first_point_[cell] == first_point_[cell + 1]) continue;
      near_.clear();
      for (const auto [first, end] : cells_.around(cell))
        near_.add(columns_, first_cluster_[first], first_cluster_[end]);
      near_.pad();
      for (std::uint32_t k = first_point_[cell]; k < first_point_[cell + 1]; ++k) {
        Member& member = members_[k];
        member.owner = near_.nearest(member.point, member.owner);
        sums_[member.owner].add(member.point.position, member.point.normal, order_[k]);
      }
    }
  }

  // Sums over the members of a cluster.
  struct Sum {
    glm::dvec3 position{0};
    glm::vec3 normal{0};
    std::uint32_t count = 0;
    std::uint32_t any = 0;  // index of one of the members

    void add(const glm::vec3& at, const glm::vec3& facing, std::size_t index) {
      position += glm::dvec3(at);
      normal += facing;
      count += 1;
      any = static_cast<std::uint32_t>(index);
    }
  };
  struct Member {
    ClusterPoint point;
    std::uint32_t owner;
  };

  std::span<const SurfacePoint> points_;
  std::vector<std::uint32_t>& owners_;
  std::vector<Cluster> clusters_;
  std::vector<Sum> sums_;
  PointCells cells_;                                        // after the members that begin() fills
  std::vector<std::size_t> levels_;                         // of the cells, for each cluster
  std::size_t step_ = 0;                                    // of the points in order_
  std::vector<std::uint32_t> order_, first_point_;          // points by cell
  std::vector<Member> members_;                             // of the points in order_
  std::vector<std::uint32_t> clusters_in_, first_cluster_;  // clusters by cell
  ClusterColumns columns_, near_;  // in the order of clusters_in_; around a cell
};

}  // namespace

std::vector<Cluster> cluster_points(std::span<const SurfacePoint> points, std::size_t count,
                                    unsigned rounds, std::vector<std::uint32_t>& owners) {
  owners.clear();
  if (points.empty() || count == 0) return {};
  Lloyd lloyd(points, std::min(count, points.size()), owners);
  const std::size_t early = std::max<std::size_t>(1, points.size() / (kEarlyPoints * count));
  for (unsigned i = 1; i < rounds; ++i) lloyd.round(kStride, i + kFullRounds > rounds ? 1 : early);
  if (rounds > 0) lloyd.round(1, 1);
  return lloyd.finish();
}

}  // namespace ptc
