// Examines what lies around a place on a mesh: where the surface ends next to it, and whether the
// place lies inside a solid.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "engine/scene/ray_scene.h"

namespace ptc {

/// Returns how far a disc moves in its plane, away from the edges of the surface that it sticks out
/// over, until it sticks out about as much as it leaves uncovered.
///
///        . - .                        . - .
///      /      |\                    /       |
///     |   x   | |     --->         |   x    |)    | is the edge of the surface
///      \      |/                    \       |
///        ' - '                        ' - '
///
/// The result is 0 where the surface goes on all around, or where another surface stands at its
/// end: what sticks out behind that one is not seen.
/// @param position  on the surface or near it, scene units
/// @param normal    unit
/// @param radius    of the disc, scene units
/// @return          scene units; shorter than 1.1 radii
[[nodiscard]] glm::vec3 move_inwards(const RayScene& scene, const glm::dvec3& position,
                                     const glm::vec3& normal, float radius);

/// Reports whether a place sees nothing but backs of one-sided triangles: it lies inside a solid,
/// or on a face that touches another.
///
/// The test sends 8 cosine rays: none may escape, and at most one may meet a front, which belongs
/// to a second solid that is sunk into the same one. The result is deterministic in `seed`.
/// @param origin  of the rays, scene units, as step_off() returns it
/// @param normal  unit, on the side that is asked about
[[nodiscard]] bool is_buried(const RayScene& scene, const glm::dvec3& origin,
                             const glm::vec3& normal, std::uint64_t seed);

}  // namespace ptc
