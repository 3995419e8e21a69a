// The camera that sees a whole scene.
#pragma once

#include <array>
#include <optional>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/scene/camera.h"
#include "engine/store/reader.h"

namespace ptc {

/// Returns a camera that sees a scene from the front, the right and above, and from higher above
/// where the scene is flat. The scene fills the picture as far as its shape allows. What fits are
/// the clusters of a coarse level of the octree, but for the 2,000th part of their area that
/// reaches farthest to each side, so that a point that strayed does not shrink the scene; of a
/// subject nothing is left out. Where node pages are damaged, `subject` or the bounds of the points
/// are taken.
/// @param up       unit; the axis that points up
/// @param subject  box around the part of the scene that is to fill the picture, such as what
///                 stands on a backdrop; the rest may leave the picture; empty: the whole scene
/// @param size     width and height of the picture; empty: those of the camera
/// @throws std::system_error
/// Memory: 17 MiB, and 4 bytes for each page of the container.
[[nodiscard]] Camera overview(const ContainerReader& scene, const glm::dvec3& up,
                              const std::optional<Bounds>& subject,
                              const std::optional<std::array<unsigned, 2>>& size);

}  // namespace ptc
