// Where rays from a surface point begin.
#pragma once

#include <optional>

#include <glm/vec3.hpp>

#include "engine/scene/ray_scene.h"

namespace ptc {

/// Moves a surface point off its surface, and away from the edges of its triangle, by a few
/// epsilons of the scene, so that rays from it meet what is there and only that.
/// @param normal  unit, on the side from which light is wanted
/// @return        nothing when another surface lies over the point within that distance: it sits in
///                an acute corner or under a contact, where no light comes
[[nodiscard]] std::optional<glm::dvec3> step_off(const RayScene& scene, const glm::dvec3& position,
                                                 const glm::vec3& normal);

}  // namespace ptc
