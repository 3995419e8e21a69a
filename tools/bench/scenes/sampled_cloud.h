// Points that are drawn from a mesh, as a scanner would take them: with noise, gaps and an uneven
// density.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/ray_scene.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// How points are drawn.
struct SampleOptions {
  std::uint64_t points = 1'000'000;  ///< about so many where the density changes or gaps are cut
  double noise = 0;  ///< Gaussian noise along each axis, in spacings sqrt(area / points)
  /// Densest over sparsest: the density falls along x as a power, from 1 at one end of the mesh to
  /// 1 / ratio at the other.
  double ratio = 1;
  /// Number of balls, at random points of the mesh, in which no point is drawn. Their radius is
  /// four spacings.
  unsigned holes = 0;
};

/// A point that was drawn.
struct SampledPoint {
  glm::dvec3 position{0};  ///< with its noise, scene units
  glm::dvec3 origin{0};    ///< where it was drawn, on the mesh
  glm::vec3 normal{0};     ///< of the triangle, unit
};

/// Returns the area of a mesh.
[[nodiscard]] double area_of(const Mesh& mesh);
/// Draws points from the mesh of a scene, uniformly by area but for the options, in the order of
/// its triangles. Points that solids enclose, where no scanner sees them, are left out. Equal
/// options give equal points.
[[nodiscard]] std::vector<SampledPoint> sample_at_random(const RayScene& scene,
                                                         const SampleOptions& options);

/// Returns the mesh of a scene. @param points  decides how finely procedural meshes are divided
/// @pre its file is no cloud
[[nodiscard]] Mesh mesh_of(const SceneChoice& choice, std::uint64_t points, const RunOptions& run);

}  // namespace ptc::bench
