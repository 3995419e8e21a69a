// Places that are spread evenly over triangles of a mesh.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/ray_scene.h"

namespace ptc {

/// Places on some triangles of a mesh, at equal steps of their area.
/// Memory: 12 bytes for each of the triangles.   Threads: place() may be called concurrently.
class PlacesByArea {
 public:
  /// @param scene      must outlive this
  /// @param triangles  indices in Mesh::triangles
  /// @param seed       fixes where a place lies on its triangle
  PlacesByArea(const RayScene& scene, std::span<const std::uint32_t> triangles, std::uint64_t seed);

  /// Returns the area of the triangles, scene units squared.
  [[nodiscard]] double area() const noexcept { return reached_.empty() ? 0 : reached_.back(); }
  /// Returns a place of `count`.   @pre area() > 0
  [[nodiscard]] SurfaceHit place(std::uint32_t index, std::uint32_t count) const;

 private:
  const RayScene& scene_;
  std::vector<std::uint32_t> triangles_;
  std::vector<double> reached_;  ///< sums of the area up to and with each triangle
  SquarePoints points_;
};

}  // namespace ptc
