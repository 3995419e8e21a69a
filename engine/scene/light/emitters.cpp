#include "engine/scene/light/emitters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "engine/scene/sampling/sub_triangle.h"
#include "engine/scene/texture.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxPieces = 65536;  // of all textured triangles
// A piece is cut while its radiance varies by more than this share of its material's brightest
// texel
constexpr float kEven = 0.01F;
// Texels of a piece that is looked at as a whole, and the most samples along its edges
constexpr double kTexels = 256;
constexpr double kLeast = 1.0 / 64;  // texels of a piece that is not cut further
constexpr unsigned kMaxSide = 64;

/// The emission over a part of a triangle.
struct Range {
  glm::dvec3 mean{0};
  glm::vec3 low{0}, high{0};
};

/// Cuts one triangle.
class Cutter {
 public:
  /// @param brightest  the largest values of the emission texture
  Cutter(const Mesh& mesh, std::uint32_t triangle, const glm::vec3& brightest, unsigned depth,
         std::vector<Emitter>& out)
      : mesh_(mesh),
        corners_(mesh.triangles[triangle]),
        material_(mesh.materials[mesh.material_of[triangle]]),
        even_(kEven * material_.emission * brightest),
        depth_(depth),
        out_(out) {
    cut(whole_triangle(mesh, triangle), 0);
  }

 private:
  /// Returns the place of a part's barycentric coordinates on the texture.
  [[nodiscard]] glm::vec2 on_texture(const glm::dvec2& at) const {
    const auto uv = [&](std::size_t i) { return glm::dvec2(mesh_.uvs[corners_[i]]); };
    return glm::vec2((1 - at.x - at.y) * uv(0) + at.x * uv(1) + at.y * uv(2));
  }

  /// Returns how many texels a part covers.
  [[nodiscard]] double texels(const SubTriangle& part) const {
    const glm::dvec2 a(on_texture(part.uv[0])), b = glm::dvec2(on_texture(part.uv[1])) - a,
                                                c = glm::dvec2(on_texture(part.uv[2])) - a;
    double size = 0;  // of the larger texture, pixels
    for (const auto* image : {&material_.emission_texture, &material_.opacity_texture})
      if (*image) size = std::max(size, static_cast<double>((*image)->size()));
    const double area = 0.5 * std::abs(b.x * c.y - b.y * c.x) * size;
    return std::isfinite(area) ? area : 0;
  }

  /// Looks at a part, at the middles of about as many small triangles as it has texels.
  [[nodiscard]] Range look(const SubTriangle& part, double texel_count) const {
    const auto side =
        static_cast<unsigned>(std::clamp(std::ceil(std::sqrt(texel_count)), 4.0, double{kMaxSide}));
    Range range{.low = glm::vec3(std::numeric_limits<float>::max())};
    const auto add = [&](double u, double v) {
      const glm::dvec2 at = (1 - u - v) * part.uv[0] + u * part.uv[1] + v * part.uv[2];
      const glm::vec2 uv = on_texture(at);
      glm::vec3 light = material_.emission * opacity_at(material_, uv);
      if (material_.emission_texture)
        light *= sample_texture(*material_.emission_texture, uv, material_.emission_wrap);
      range.mean += glm::dvec3(light);
      range.low = glm::min(range.low, light);
      range.high = glm::max(range.high, light);
    };
    for (unsigned j = 0; j < side; ++j) {
      for (unsigned i = 0; i + j < side; ++i) {
        add((i + 1.0 / 3) / side, (j + 1.0 / 3) / side);
        if (i + j + 1 < side) add((i + 2.0 / 3) / side, (j + 2.0 / 3) / side);
      }
    }
    range.mean /= side * side;
    return range;
  }

  void cut(const SubTriangle& part, unsigned depth) {
    const auto halve = [&] {
      cut(part.half(false), depth + 1);
      cut(part.half(true), depth + 1);
    };
    const double count = texels(part);
    if (depth < depth_ && count > kTexels) return halve();
    const Range range = look(part, count);
    const bool varies = glm::any(glm::greaterThan(range.high - range.low, even_));
    if (depth < depth_ && varies && count > kLeast) return halve();
    const glm::vec3 radiance(range.mean);
    if (radiance == glm::vec3(0)) return;
    out_.push_back(
        {{glm::vec3(part.corner[0]), glm::vec3(part.corner[1]), glm::vec3(part.corner[2])},
         radiance});
  }

  const Mesh& mesh_;
  const std::array<std::uint32_t, 3>& corners_;
  const Material& material_;
  glm::vec3 even_;  ///< the most by which the radiance of a piece varies
  unsigned depth_;
  std::vector<Emitter>& out_;
};

/// Returns the largest value of each channel.
glm::vec3 brightest(const Texture& image) {
  glm::vec3 most(0);
  image.visit_rows([&most](std::span<const glm::vec3> row) {
    for (const glm::vec3& pixel : row) most = glm::max(most, pixel);
  });
  return most;
}

}  // namespace

std::vector<Emitter> emitters_of(const Mesh& mesh) {
  const auto is_textured = [&](std::uint16_t material) {
    const Material& m = mesh.materials[material];
    return m.emission != glm::vec3(0) && (m.emission_texture || m.opacity_texture) &&
           !mesh.uvs.empty();
  };
  const auto textured =
      static_cast<std::size_t>(std::ranges::count_if(mesh.material_of, is_textured));
  unsigned depth = 0;
  while (textured > 0 && (textured << (depth + 1)) <= kMaxPieces) ++depth;
  std::vector<glm::vec3> most(mesh.materials.size(), glm::vec3(1));
  for (std::size_t i = 0; textured > 0 && i < most.size(); ++i) {
    const Material& m = mesh.materials[i];
    if (m.emission != glm::vec3(0) && m.emission_texture) most[i] = brightest(*m.emission_texture);
  }
  std::vector<Emitter> emitters;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::uint16_t material = mesh.material_of[i];
    const Material& of = mesh.materials[material];
    if (of.emission == glm::vec3(0)) continue;
    const auto& c = mesh.triangles[i];
    if (is_textured(material)) {
      Cutter(mesh, static_cast<std::uint32_t>(i), most[material], depth, emitters);
    } else {
      emitters.push_back({{mesh.positions[c[0]], mesh.positions[c[1]], mesh.positions[c[2]]},
                          of.emission * opacity_at(mesh, static_cast<std::uint32_t>(i), {})});
    }
  }
  return emitters;
}

}  // namespace ptc
