// The mesh as rays see it: closest hits, shadow tests and surface data, on top of Embree.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Checks that a mesh can be traced: every index and array length fits, and every position is at
/// most 1e18 from the mesh's origin on each axis.
/// @param field  the member of the request that the mesh comes from, for the error
/// @throws RequestError when it cannot; the message says why
void check_mesh(const Mesh& mesh, const char* field = "mesh");

/// A point of a mesh's surface and the material there.
struct SurfaceHit {
  double distance = 0;            ///< along the ray from its origin, scene units; 0 without a ray
  std::uint32_t triangle = 0;     ///< index in Mesh::triangles
  glm::dvec3 position{0};         ///< scene units, Mesh::origin included
  glm::vec3 geometric_normal{0};  ///< unit, of the triangle's front side (counter-clockwise)
  glm::vec3 normal{0};    ///< unit, interpolated; never on the back side of the geometric normal
  glm::vec3 albedo{0};    ///< reflectance of the material, times texture and vertex colour there
  glm::vec3 emission{0};  ///< radiance that the front side emits, W/(m^2 sr), where it is opaque
  float opacity = 1;      ///< share of light that the surface stops there
  bool front = true;      ///< whether the ray met the front side
};

/// Where a ray meets a mesh, without the surface data there.
struct TriangleHit {
  double distance = 0;         ///< along the ray from its origin, scene units
  std::uint32_t triangle = 0;  ///< index in Mesh::triangles
  float u = 0, v = 0;          ///< barycentric coordinates as RayScene::surface() takes them
  bool front = true;           ///< whether the ray met the front side
};

/// Closest-hit and any-hit queries on a mesh.
///
/// Rays are moved into a frame at the middle of the mesh, in double, before they become float, so
/// that the precision is that of the mesh's extent wherever the mesh lies and wherever the ray
/// begins. A ray through a shared edge or vertex never slips through; it hits either triangle.
/// Where a material is not opaque, a ray meets it or goes on, by chance: the share of rays that
/// meet it is its opacity there. The same ray has the same luck every time. Memory: bytes(), about
/// 80 bytes for each triangle. Threads: const members may be called concurrently.
class RayScene {
 public:
  /// Builds Embree's tree over the mesh.
  /// @param mesh  must outlive this; only its materials may change
  /// @throws RequestError when check_mesh() does; std::bad_alloc; std::runtime_error when Embree
  ///         reports another error
  explicit RayScene(const Mesh& mesh);
  ~RayScene();

  /// Returns the mesh that the constructor was given.
  [[nodiscard]] const Mesh& mesh() const noexcept;
  /// Returns the bytes that Embree holds: its tree and a copy of the positions.
  [[nodiscard]] std::uint64_t bytes() const noexcept;
  /// Returns the first surface point on a ray, or nothing when the ray misses.
  /// @param origin     scene units
  /// @param direction  unit; a ray that holds a NaN, or a number beyond 1e18, misses
  /// @param near, far  interval of distances that count, scene units; `far` may be infinite
  [[nodiscard]] std::optional<SurfaceHit> closest(const glm::dvec3& origin,
                                                  const glm::vec3& direction, double near,
                                                  double far) const;
  /// Returns the triangle that closest() finds. Its parameters are those of closest(), and it is
  /// faster.
  [[nodiscard]] std::optional<TriangleHit> closest_triangle(const glm::dvec3& origin,
                                                            const glm::vec3& direction, double near,
                                                            double far) const;
  /// Reports whether any surface lies on a ray between `near` and `far`. Its parameters are those
  /// of closest(), and it is faster.
  [[nodiscard]] bool occluded(const glm::dvec3& origin, const glm::vec3& direction, double near,
                              double far) const;
  /// Reports the same of up to kRaysAtOnce rays from one place, which is faster than one at a time.
  /// @return  bit i says whether any surface lies on the ray along `directions[i]`
  [[nodiscard]] std::uint32_t occluded(const glm::dvec3& origin,
                                       std::span<const glm::vec3> directions, double near,
                                       double far) const;
  static constexpr std::size_t kRaysAtOnce = 16;
  /// Returns the distance by which a ray's origin steps off a surface so that the ray does not
  /// meet that surface again, scene units: 16 float ulps of half the mesh's largest extent.
  [[nodiscard]] double epsilon() const noexcept;
  /// Returns the surface data of a point that is given by barycentric coordinates.
  ///
  ///     corner 2 (v = 1)
  ///        |\            position = (1 - u - v) corner 0 + u corner 1 + v corner 2
  ///        | \           Row 0 of a texture is at texture coordinate 1, as OBJ has it.
  ///        +--- corner 1 (u = 1)
  ///     corner 0
  ///
  /// @throws std::invalid_argument when `triangle` is out of range
  [[nodiscard]] SurfaceHit surface(std::uint32_t triangle, float u, float v) const;
  /// Says whether a triangle has the same normal, albedo and emission everywhere.
  /// @param triangle  below the number of triangles
  [[nodiscard]] bool is_plain(std::uint32_t triangle) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
