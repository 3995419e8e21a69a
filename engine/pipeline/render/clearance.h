// Internal to views of meshes: how far receivers keep from surfaces that meet their own.
#pragma once

#include <glm/vec3.hpp>

#include "engine/scene/ray_scene.h"

namespace ptc {

/// Returns where a receiver lies, before it rises, of a place where a ray meets a mesh: there, or
/// beside it, in the plane of the surface, 2.3 lifts away from walls: surfaces that stand on it or
/// lean over it.
///
///      wall |            Discs of both sides leave gaps along the edge. A receiver as near to
///           |<----->     them as p looks through one of them or not, so that its pixel flickers
///           |  p--->x    when the camera moves; x does not.
///     ------+--------
///
/// A receiver between two walls keeps from both, and stands half way where they are too close; of
/// three or more walls it keeps from the two nearest ones.
/// @param normal   of the surface at the place, unit, turned to where the ray comes from
/// @param towards  direction of the ray, unit
/// @param lift     by which the receiver will rise, scene units
/// @return         scene units; the place itself where nothing is near
[[nodiscard]] glm::dvec3 clear_of_walls(const RayScene& scene, const glm::dvec3& place,
                                        const glm::vec3& normal, const glm::vec3& towards,
                                        double lift);

}  // namespace ptc
