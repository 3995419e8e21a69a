// What must be known of meshes that do not fit in memory before they are sampled.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/scene/sampling/mesh_parts.h"

namespace ptc {

/// The places of a mesh in which it has the same shape but for its size: the surfels of one serve
/// for all. With the Cholesky factor R of M^T M, the linear part M of a place is a rotation times
/// R; R over its size is the shape (spec/shading.md#streamed-meshes says which shapes count as
/// one).
struct PlacementGroup {
  std::size_t mesh = 0;               ///< index into MeshParts::placed()
  glm::dmat3 shape{1};                ///< maps the mesh to the shape, determinant 1
  bool is_plain = true;               ///< the shape is that of the mesh
  std::vector<std::uint32_t> places;  ///< indices into PlacedMesh::places
  double area = 0;  ///< of the mesh in this shape; both sides count as in SurfaceSurvey::area
};

/// Returns the size of a mesh in its place: the cube root of the volume of a unit cube there.
[[nodiscard]] double size_of(const Placement& place);

/// What was found of a surface.
struct SurfaceSurvey {
  /// Returns the number of places of MeshParts::placed(), each of which gets a surfel at least.
  [[nodiscard]] std::uint64_t places() const noexcept {
    std::uint64_t count = 0;
    for (const PlacementGroup& group : groups) count += group.places.size();
    return count;
  }

  /// The area of all meshes in all places, scene units squared. Both sides of double-sided
  /// materials count.
  double area = 0;
  std::uint64_t triangles = 0;  ///< of all meshes, each once for each shape
  bool emits = false;           ///< a triangle has a material that emits light
  bool keeps_sides = false;     ///< closed meshes keep both of their sides
  /// Places that are spread evenly over the meshes that stand in one place, some by area and some
  /// by the number of triangles, scene units.
  std::vector<glm::dvec3> by_area, by_count;
  std::vector<glm::dvec3> placed_by_area;  ///< places by area on MeshParts::placed()
  std::vector<PlacementGroup> groups;      ///< of MeshParts::placed(), in its order
};

/// Reads all triangles once. The materials of parts that are closed, and whose fronts look
/// outwards, become one-sided: what is inside is dark.
/// @param places  wanted of each kind, at least; there are fewer than twice as many, unless there
///                are fewer triangles
/// @param lamps   whether lights may be inside of a part; then, or when a triangle emits light, all
///                parts keep their sides
[[nodiscard]] SurfaceSurvey survey(MeshParts& parts, std::size_t places, bool lamps);

}  // namespace ptc
