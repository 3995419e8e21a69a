// Bilinear lookups in pictures, by texture coordinate or by place on a panorama.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/image/texture.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Returns the bilinear value of a texture.
/// @param uv  texture coordinates; v = 1 is the top of row 0. A coordinate that is not finite
///            counts as 0.
/// @param wrap  what lies beyond the borders
/// @return    white where the picture has no pixels
/// @throws as Texture::at()
[[nodiscard]] glm::vec3 sample_texture(const Texture& image, const glm::vec2& uv,
                                       const TextureWrap& wrap = {});

/// Returns the bilinear value of a latitude-longitude map. Columns wrap around; the first and the
/// last row go on beyond the map as they are.
/// @param image  has at least one pixel
/// @param x, y   place in pixels; 0 is the left or the top border of the picture
/// @throws as Texture::at()
[[nodiscard]] glm::vec3 sample_panorama(const Texture& image, double x, double y);

}  // namespace ptc
