// Finds the solids of a mesh, of which only the outside can be seen.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"

namespace ptc {

/// The closed surfaces of a mesh whose fronts look outwards. Surfaces that share a vertex position
/// are one.
struct Solids {
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  /// Number of the closed surface that each vertex of the mesh is on, or kNone; empty where there
  /// is no closed surface.
  std::vector<std::uint32_t> of_vertex;
  std::uint32_t count = 0;
};

/// Says whether a closed surface looks outwards: whether its fronts enclose a volume.
/// @param volume  sum over its triangles, positive where they turn their back to an inner point
/// @param area    of the surface
[[nodiscard]] bool looks_outwards(double volume, double area);

/// Finds the closed surfaces of a mesh. Nothing is looked for where no material is double-sided.
/// Memory: up to 24 bytes a triangle and 16 a vertex during the call.
[[nodiscard]] Solids find_solids(const Mesh& mesh);

/// Makes the materials of solids one-sided. Exporters declare most materials double-sided, also
/// those of boxes and balls, inside of which all is dark: surfels there would be half of all, and
/// a cluster of a thin wall would show what its other half has to hide.
///
/// A closed surface is no solid but a room when something inside emits, a point or a spot light is
/// inside, or of 64 rays from its back more than 6 meet a front; what stands in a room can be lit
/// later. What touches a front over much of its area keeps both sides, too.
/// @param mesh    that of `scene`
/// @param lights  of the scene, whether they light it now or later
void close_solids(Mesh& mesh, const Solids& solids, const RayScene& scene, const LightRig& lights);

}  // namespace ptc
