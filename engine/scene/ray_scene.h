// The mesh under rays (Embree).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"

namespace ptc {

/// @throws RequestError when an index is out of range, an array has the wrong length or a
///         position is beyond 1e18
void check_mesh(const Mesh& mesh);

struct SurfaceHit {
  double distance = 0;
  std::uint32_t triangle = 0;
  glm::dvec3 position{0};
  glm::vec3 geometric_normal{0};  ///< unit, of the triangle's front side (counter-clockwise)
  glm::vec3 normal{0};            ///< unit, interpolated; on the side of the geometric normal
  glm::vec3 albedo{0};            ///< material at the hit, texture included
  glm::vec3 emission{0};
  bool front = true;  ///< the ray met the front side
};

/// Closest-hit and any-hit queries on a mesh. Threads: may be called concurrently.
///
/// Rays are moved into a frame at the middle of the mesh, in double, before they become float, so
/// that the precision is that of the mesh's extent wherever the mesh lies and wherever the ray
/// begins. A ray through a shared edge or vertex never slips through; it hits either triangle.
/// Memory: bytes(), about 80 a triangle.
class RayScene {
 public:
  /// @param mesh  must outlive this and not change
  /// @throws RequestError as check_mesh()
  explicit RayScene(const Mesh& mesh);
  ~RayScene();

  [[nodiscard]] const Mesh& mesh() const noexcept;
  /// What Embree holds: its tree and a copy of the positions.
  [[nodiscard]] std::uint64_t bytes() const noexcept;
  /// @param origin     scene units; the hit is beyond `near`
  /// @param direction  unit; a ray with a NaN in it, or beyond 1e18, misses
  [[nodiscard]] std::optional<SurfaceHit> closest(const glm::dvec3& origin,
                                                  const glm::vec3& direction, double near,
                                                  double far) const;
  [[nodiscard]] bool occluded(const glm::dvec3& origin, const glm::vec3& direction, double near,
                              double far) const;
  /// Distance to step off a surface at p so that rays do not meet it again: 16 float ulps of half
  /// the mesh's largest extent.
  [[nodiscard]] double epsilon() const noexcept;
  /// Surface data of a point given by barycentric coordinates: u is the weight of the triangle's
  /// second corner, v of its third. A texture's row 0 is at texture coordinate 1 (OBJ's sense).
  /// @throws std::invalid_argument when there is no such triangle
  [[nodiscard]] SurfaceHit surface(std::uint32_t triangle, float u, float v) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
