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

namespace ptc {

/// Entries past the last one that a kernel may read and write.
inline constexpr std::size_t kListLanes = 8;

inline constexpr std::uint32_t kInterior = 1;  ///< bit of ClusterPayload::kind: has a group below
inline constexpr std::uint32_t kClosed = 2;    ///< bit of ClusterPayload::kind: its children are
                                               ///< lost, so it is drawn and never opened

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
      column->resize(2 * wanted);
    payload.resize(2 * wanted);
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
    for (auto* column : {&x, &y, &z, &nx, &ny, &nz, &radius}) column->resize(2 * wanted);
    rgbe.resize(2 * wanted);
  }
};

/// Everything that one cell leaves to its children.
struct NearLists {
  NearClusters clusters;
  NearSurfels surfels;

  /// Reports whether nothing is left.
  [[nodiscard]] bool empty() const noexcept { return clusters.size == 0 && surfels.size == 0; }
  /// Empties the lists; their memory stays.
  void clear() noexcept { clusters.size = surfels.size = 0; }
};

}  // namespace ptc
