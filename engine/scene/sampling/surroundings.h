// What lies around a place on a mesh: where the surface ends beside it, and whether it lies inside
// a solid.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "engine/scene/ray_scene.h"

namespace ptc {

/// How far a disc of `radius` moves in its plane, away from edges of the surface that it sticks out
/// over, until it sticks out about as much as it leaves uncovered. 0 where the surface goes on all
/// around, or another surface stands where it ends: what sticks out behind that is not seen.
/// @param position  on the surface or near it, scene units
/// @param normal    unit
/// @return          scene units; shorter than 1.1 radii
[[nodiscard]] glm::vec3 move_inwards(const RayScene& scene, const glm::dvec3& position,
                                     const glm::vec3& normal, float radius);

/// Whether a place sees nothing but backs of one-sided triangles: it lies inside a solid, or on a
/// face that touches another. Of 8 cosine rays none escapes and at most one meets a front (of a
/// solid sunk into the same one). Deterministic in `seed`.
/// @param normal  unit, on the side that is asked about
[[nodiscard]] bool is_buried(const RayScene& scene, const glm::dvec3& position,
                             const glm::vec3& normal, std::uint64_t seed);

}  // namespace ptc
