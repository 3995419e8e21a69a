// What a receiver cell leaves to its children, decoded once: columns, so that several are tested at
// once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ptc {

/// A kernel may write so many entries past the last, and reads as many.
inline constexpr std::size_t kListLanes = 8;

inline constexpr std::uint32_t kInterior = 1;
inline constexpr std::uint32_t kClosed = 2;  ///< not to be opened: its children are lost

/// What drawing or opening a cluster needs; the rest is in NearClusters.
struct alignas(64) ClusterPayload {
  std::uint32_t rgbe[6];       ///< mean radiance towards each axis
  float share[6];              ///< of the area that faces each axis
  float area;                  ///< scene units squared
  std::uint32_t reference[2];  ///< as in the group (spec/nodes.md#node-group)
  std::uint32_t kind;          ///< kInterior, kClosed or both; 0 for a leaf that can be opened
};
static_assert(sizeof(ClusterPayload) == 64);

/// Clusters, relative to the centre of the cell that left them, in edges of the frame.
struct NearClusters {
  std::vector<float> x, y, z, radius, thickness;
  std::vector<float> mean_x, mean_y, mean_z;  ///< normal over area, not unit
  std::vector<std::uint32_t> payload;
  std::size_t size = 0;

  /// Makes room for so many more, and what a kernel writes past them.
  void make_room(std::size_t more) {
    const std::size_t wanted = size + more + kListLanes;
    if (x.size() >= wanted) return;
    for (auto* column : {&x, &y, &z, &radius, &thickness, &mean_x, &mean_y, &mean_z})
      column->resize(2 * wanted);
    payload.resize(2 * wanted);
  }
};

/// Surfels, likewise.
struct NearSurfels {
  std::vector<float> x, y, z, nx, ny, nz, radius;
  std::vector<std::uint32_t> rgbe;
  std::size_t size = 0;

  void make_room(std::size_t more) {
    const std::size_t wanted = size + more + kListLanes;
    if (x.size() >= wanted) return;
    for (auto* column : {&x, &y, &z, &nx, &ny, &nz, &radius}) column->resize(2 * wanted);
    rgbe.resize(2 * wanted);
  }
};

/// All that one cell leaves.
struct NearLists {
  NearClusters clusters;
  NearSurfels surfels;

  [[nodiscard]] bool empty() const noexcept { return clusters.size == 0 && surfels.size == 0; }
  void clear() noexcept { clusters.size = surfels.size = 0; }
};

}  // namespace ptc
