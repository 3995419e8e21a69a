// The clusters and surfels that a receiver cell leaves to its children, decoded once. They lie in
// columns, so that kernels test several at once:
//
//     index      0    1    2   ...  size - 1 | up to kListLanes more that a kernel may write
//     x         [ ]  [ ]  [ ]       [ ]      |
//     y         [ ]  [ ]  [ ]       [ ]      |
//     ...
//     payload   [3]  [7]  [8]       [ ]      |   index of a ClusterPayload, read only when the
//                                                cluster is drawn or opened
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace ptc {

/// Relative rounding error of cell-relative lengths after a few float operations.
inline constexpr float kRounding = 4e-7F;

/// Entries past the last one that a kernel may read and write.
inline constexpr std::size_t kListLanes = 8;

inline constexpr std::uint32_t kInterior = 1;  ///< bit of ClusterPayload::kind: has a group below
inline constexpr std::uint32_t kClosed = 2;    ///< bit of ClusterPayload::kind: its children are
                                               ///< lost, so it is drawn and never opened

/// Makes room for `more` elements and a quarter beyond: a vector by itself takes twice as much.
template <class T>
void make_room_in(std::vector<T>& elements, std::size_t more) {
  const std::size_t wanted = elements.size() + more;
  if (wanted > elements.capacity()) elements.reserve(wanted + wanted / 4);
}
/// Makes a column longer than is wanted now: resize() alone may take twice what it is asked for.
template <class T>
void lengthen(std::vector<T>& column, std::size_t wanted) {
  column.reserve(wanted + wanted / 4);
  column.resize(wanted + wanted / 4);
}

/// The part of a cluster that is needed only to draw or to open it; the rest is in NearClusters.
/// It fills one cache line. Axes are ordered +x -x +y -y +z -z.
struct alignas(64) ClusterPayload {
  std::uint32_t rgbe[6];       ///< mean radiance towards each axis
  float share[6];              ///< share of the area that faces each axis
  float area;                  ///< scene units squared
  std::uint32_t reference[2];  ///< low and high half of the child's reference, as in the group
                               ///< (spec/nodes.md#node-group)
  std::uint32_t kind;          ///< kInterior, kClosed or both; 0 for a leaf that can be opened
};
static_assert(sizeof(ClusterPayload) == 64);

/// Clusters in columns. Positions are relative to the centre of the cell that left them, and
/// lengths are in edges of the frame.
struct NearClusters {
  std::vector<float> x, y, z, radius, thickness;
  std::vector<float> mean_x, mean_y, mean_z;  ///< sum of area times normal over the area; not unit
  std::vector<std::uint32_t> payload;         ///< index of the ClusterPayload
  std::size_t size = 0;                       ///< clusters in the columns

  /// Makes room for `more` clusters and for what a kernel writes past them.
  void make_room(std::size_t more) {
    const std::size_t wanted = size + more + kListLanes;
    if (x.size() >= wanted) return;
    for (auto* column : {&x, &y, &z, &radius, &thickness, &mean_x, &mean_y, &mean_z})
      lengthen(*column, wanted);
    lengthen(payload, wanted);
  }
  /// Reports whether all of a cluster is nearer than a distance.
  /// @param move  is added to its position
  [[nodiscard]] bool is_within(float distance, std::size_t i, const glm::vec3& move) const {
    return glm::length(glm::vec3(x[i], y[i], z[i]) + move) + radius[i] < distance;
  }
  /// Appends a cluster that the enclosing cell left. Radius and thickness grow by the rounding of
  /// the position.
  /// @param i     its index there
  /// @param move  is added to its position
  void take(const NearClusters& around, std::size_t i, const glm::vec3& move) {
    make_room(1);
    const glm::vec3 to = glm::vec3(around.x[i], around.y[i], around.z[i]) + move;
    const float rounding = kRounding * glm::length(to);
    x[size] = to.x;
    y[size] = to.y;
    z[size] = to.z;
    radius[size] = around.radius[i] + rounding;
    thickness[size] = around.thickness[i] + rounding;
    mean_x[size] = around.mean_x[i];
    mean_y[size] = around.mean_y[i];
    mean_z[size] = around.mean_z[i];
    payload[size++] = around.payload[i];
  }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return (8 * sizeof(float) + sizeof(std::uint32_t)) * payload.capacity();
  }
};

/// Surfels in columns. Positions are relative to the centre of the cell that left them, and lengths
/// are in edges of the frame.
struct NearSurfels {
  std::vector<float> x, y, z, nx, ny, nz, radius;
  std::vector<std::uint32_t> rgbe;  ///< radiance of the front
  std::size_t size = 0;             ///< surfels in the columns

  /// Makes room for `more` surfels and for what a kernel writes past them.
  void make_room(std::size_t more) {
    const std::size_t wanted = size + more + kListLanes;
    if (x.size() >= wanted) return;
    for (auto* column : {&x, &y, &z, &nx, &ny, &nz, &radius}) lengthen(*column, wanted);
    lengthen(rgbe, wanted);
  }
  [[nodiscard]] std::size_t bytes() const noexcept {
    return (7 * sizeof(float) + sizeof(std::uint32_t)) * rgbe.capacity();
  }
};

/// Everything that one cell leaves to its children.
struct NearLists {
  NearClusters clusters;
  NearSurfels surfels;

  /// Returns the number of things that are left.
  [[nodiscard]] std::size_t size() const noexcept { return clusters.size + surfels.size; }
  /// Empties the lists; their memory stays.
  void clear() noexcept { clusters.size = surfels.size = 0; }
};

}  // namespace ptc
