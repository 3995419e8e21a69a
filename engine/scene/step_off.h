// Finds where the rays from a surface point begin.
#pragma once

#include <optional>

#include <glm/vec3.hpp>

#include "engine/scene/ray_scene.h"

namespace ptc {

/// Moves a surface point off its surface, and away from the edges of its triangle, by a few
/// RayScene::epsilon(). Rays from there meet every surface around the point except its own, and
/// none of them slips through a neighbouring wall.
/// @param position  scene units, on the surface or within rounding of it
/// @param normal    unit, on the side from which light is wanted
/// @return          the origin for rays, scene units; nothing when another surface lies over the
///                  point within that distance. Such a point sits in an acute corner or under a
///                  contact, where no light comes.
/// Threads: may be called concurrently.
[[nodiscard]] std::optional<glm::dvec3> step_off(const RayScene& scene, const glm::dvec3& position,
                                                 const glm::vec3& normal);

/// Moves a point of a known triangle off its surface in the same way.
/// @param at     what RayScene::surface() returns
/// @param front  whether light is wanted on the triangle's front
[[nodiscard]] std::optional<glm::dvec3> step_off(const RayScene& scene, const SurfaceHit& at,
                                                 bool front);

}  // namespace ptc
