// Looking up a picture at a texture coordinate.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/image/image.h"

namespace ptc {

/// Bilinear value at (u, v), which wraps around; v = 1 is the top of row 0. A coordinate that is
/// not finite counts as 0; an empty picture is white.
[[nodiscard]] glm::vec3 sample_texture(const Image& image, const glm::vec2& uv);

/// Bilinear value at a place in pixels (0 at the left or top border), where columns wrap around and
/// rows end: a latitude-longitude map.
[[nodiscard]] glm::vec3 sample_panorama(const Image& image, double x, double y);

}  // namespace ptc
