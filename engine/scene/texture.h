// Bilinear lookups in pictures, by texture coordinate or by place on a panorama.
#pragma once

#include <cstdint>
#include <optional>

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

/// Returns the share of light that a material stops, from 0 to 1: one of both where it has a
/// cutoff.
/// @param uv  as sample_texture() takes them; nothing where a mesh has none
/// @throws as Texture::at()
[[nodiscard]] float opacity_at(const Material& material, const std::optional<glm::vec2>& uv);
/// Returns the same at a point of a triangle.
/// @param barycentric  as RayScene::surface() takes them
[[nodiscard]] float opacity_at(const Mesh& mesh, std::uint32_t triangle,
                               const glm::vec2& barycentric);

/// Returns the texture coordinates of a point of a triangle. @pre the mesh has some
[[nodiscard]] glm::vec2 uv_at(const Mesh& mesh, std::uint32_t triangle,
                              const glm::vec2& barycentric);

/// Returns the bilinear value of a latitude-longitude map. Columns wrap around; the first and the
/// last row go on beyond the map as they are.
/// @param image  has at least one pixel
/// @param x, y   place in pixels; 0 is the left or the top border of the picture
/// @throws as Texture::at()
[[nodiscard]] glm::vec3 sample_panorama(const Texture& image, double x, double y);

}  // namespace ptc
