// Bilinear lookups. Pixel (i, j) has its centre at (i + 1/2, j + 1/2), so a place x lies between
// the centres of the pixels floor(x - 1/2) and floor(x - 1/2) + 1.
#include "engine/scene/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <glm/common.hpp>

namespace ptc {
namespace {

// What lies beyond the last pixel: the first one again, or the last one repeated.
enum class Border { wrap, end };

// Two neighbouring pixels of a row or column, and the share of the second one in the blend.
struct Pair {
  unsigned first;
  unsigned second;
  float share;
};

unsigned bring_inside(std::int64_t index, unsigned size, Border border) {
  const auto count = static_cast<std::int64_t>(size);
  if (border == Border::end)
    return static_cast<unsigned>(std::clamp<std::int64_t>(index, 0, count - 1));
  return static_cast<unsigned>((index % count + count) % count);
}

Pair neighbours(double at, unsigned size, Border border) {
  const double low = std::floor(at - 0.5);
  const auto index = static_cast<std::int64_t>(low);
  return {bring_inside(index, size, border), bring_inside(index + 1, size, border),
          static_cast<float>(at - 0.5 - low)};
}

// Returns two pixels of a row, which mostly lie side by side.
std::array<glm::vec3, 2> both(const Texture& image, const Pair& x, unsigned y) {
  std::array<glm::vec3, 2> pixels;
  if (x.second == x.first + 1) {
    image.read(x.first, y, pixels);
  } else {
    pixels = {image.at(x.first, y), image.at(x.second, y)};
  }
  return pixels;
}

glm::vec3 blend(const Texture& image, const Pair& x, const Pair& y) {
  const auto top = both(image, x, y.first), bottom = both(image, x, y.second);
  return glm::mix(glm::mix(top[0], top[1], x.share), glm::mix(bottom[0], bottom[1], x.share),
                  y.share);
}

// Returns the pixels around a texture coordinate. One that is not finite counts as 0.
Pair around(float coordinate, unsigned size, Wrap wrap, bool flipped) {
  double at = std::isfinite(coordinate) ? static_cast<double>(coordinate) : 0;
  if (flipped) at = 1 - at;
  switch (wrap) {
    case Wrap::clamp:
      return neighbours(std::clamp(at, 0.0, 1.0) * size, size, Border::end);
    case Wrap::mirror:
      // Fold the line, so that two lengths of the texture are one there and back
      at = std::abs(at - 2 * std::floor(at / 2 + 0.5));
      return neighbours(at * size, size, Border::end);
    case Wrap::repeat:
      break;
  }
  return neighbours((at - std::floor(at)) * size, size, Border::wrap);
}

}  // namespace

glm::vec3 sample_texture(const Texture& image, const glm::vec2& uv, const TextureWrap& wrap) {
  if (image.size() == 0) return glm::vec3(1);
  return blend(image, around(uv.x, image.width(), wrap.u, false),
               around(uv.y, image.height(), wrap.v, true));
}

float opacity_at(const Material& material, const std::optional<glm::vec2>& uv) {
  float opacity = material.opacity;
  if (material.opacity_texture && uv)
    opacity *= sample_texture(*material.opacity_texture, *uv, material.wrap).x;
  if (material.opacity_cutoff > 0) return opacity >= material.opacity_cutoff ? 1 : 0;
  return opacity;
}

float opacity_at(const Mesh& mesh, std::uint32_t triangle, const glm::vec2& barycentric) {
  const Material& material = mesh.materials[mesh.material_of[triangle]];
  if (material.is_opaque()) return 1;
  if (mesh.uvs.empty()) return opacity_at(material, std::nullopt);
  return opacity_at(material, uv_at(mesh, triangle, barycentric));
}

glm::vec2 uv_at(const Mesh& mesh, std::uint32_t triangle, const glm::vec2& barycentric) {
  const auto& c = mesh.triangles[triangle];
  return (1 - barycentric.x - barycentric.y) * mesh.uvs[c[0]] + barycentric.x * mesh.uvs[c[1]] +
         barycentric.y * mesh.uvs[c[2]];
}

glm::vec3 sample_panorama(const Texture& image, double x, double y) {
  return blend(image, neighbours(x, image.width(), Border::wrap),
               neighbours(y, image.height(), Border::end));
}

}  // namespace ptc
