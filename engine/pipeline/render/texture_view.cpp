// The triangles of texture coordinates are a mesh of their own, in the plane z = 0, in texels. A
// ray down at a sample finds the triangle there; its barycentric coordinates are those on the mesh.
#include "engine/pipeline/render/texture_view.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <optional>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/scene/sampling/mesh_parts.h"

namespace ptc {
namespace {

/// Returns the mesh whose positions are texture coordinates in texels, from the upper left corner
/// of a tile, with the triangles of `mesh`. A triangle that has no place in the tile has no area.
Mesh flattened(const Mesh& mesh, const glm::uvec2& size, const TextureTile& tile) {
  constexpr double kFarthest = 1 << 22;  // texels; beyond it floats do not tell two texels apart
  const glm::dvec2 texels(size);
  const auto place = [&](std::uint32_t vertex) {
    const glm::dvec2 at = (glm::dvec2(mesh.uvs[vertex]) - glm::dvec2(tile.corner)) * texels;
    return glm::dvec2(at.x, texels.y - at.y);
  };
  Mesh flat;
  flat.materials.resize(1);
  flat.positions.resize(mesh.positions.size(), glm::vec3(0));
  flat.material_of.resize(mesh.triangles.size(), 0);
  flat.triangles.reserve(mesh.triangles.size());
  for (const auto& corners : mesh.triangles) {
    const std::array at{place(corners[0]), place(corners[1]), place(corners[2])};
    const bool near = std::ranges::all_of(at, [](const glm::dvec2& p) {
      return std::abs(p.x) < kFarthest && std::abs(p.y) < kFarthest;  // false for a NaN
    });
    const glm::dvec2 low = glm::min(at[0], glm::min(at[1], at[2])),
                     high = glm::max(at[0], glm::max(at[1], at[2]));
    if (!near || high.x < 0 || high.y < 0 || low.x > texels.x || low.y > texels.y) {
      flat.triangles.push_back({corners[0], corners[0], corners[0]});
      continue;
    }
    flat.triangles.push_back(corners);
    for (std::size_t k = 0; k < 3; ++k) flat.positions[corners[k]] = glm::vec3(at[k], 0);
  }
  return flat;
}

/// Returns the offsets of the texels within a margin, the nearest first.
std::vector<glm::ivec2> offsets_within(unsigned margin) {
  const int reach = static_cast<int>(margin);
  std::vector<glm::ivec2> offsets;
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      if (x * x + y * y <= reach * reach) offsets.emplace_back(x, y);
    }
  }
  std::ranges::stable_sort(offsets, {}, [](const glm::ivec2& o) { return o.x * o.x + o.y * o.y; });
  return offsets;
}

}  // namespace

struct TextureView::Impl {
  Impl(const RayScene& rays, const DirectLight& lamps, const LightSampling& light_sampling,
       glm::uvec2 texels, unsigned samples, float surfel_radius, float height,
       const TextureTarget& target, const TextureTile& tile, const Executor& executor)
      : scene(rays),
        light(lamps),
        sampling(light_sampling),
        size(texels),
        side(samples),
        radius(surfel_radius),
        lift(height),
        flat(flattened(rays.mesh(), texels, tile)),
        flat_rays(flat),
        offsets(offsets_within(target.margin)),
        row_bytes((texels.x + 7) / 8),
        covers(std::size_t{row_bytes} * texels.y) {
    executor.for_each(size.y, [&](std::size_t y, unsigned) {
      for (unsigned x = 0; x < size.x; ++x) {
        if (!find({x + 0.5, static_cast<double>(y) + 0.5})) continue;
        covers[y * row_bytes + x / 8] |= static_cast<std::uint8_t>(1U << x % 8);
        ++covered;
      }
    });
  }

  /// Returns the triangle at a place of the texture, texels from its upper left corner.
  [[nodiscard]] std::optional<TriangleHit> find(const glm::dvec2& place) const {
    return flat_rays.closest_triangle({place, 1}, {0, 0, -1}, 0, 2);
  }
  [[nodiscard]] bool is_covered(const glm::ivec2& texel) const {
    if (texel.x < 0 || texel.y < 0) return false;
    const glm::uvec2 at(texel);
    return at.x < size.x && at.y < size.y &&
           (covers[std::size_t{at.y} * row_bytes + at.x / 8] >> at.x % 8 & 1) != 0;
  }

  /// Returns the step of a receiver away from the edge of its triangle, as baked_step() has it.
  [[nodiscard]] glm::dvec3 step_inwards(const SurfaceHit& at) const {
    const Mesh& mesh = scene.mesh();
    const auto& [a, b, c] = mesh.triangles[at.triangle];
    const glm::dvec3 middle = (glm::dvec3(mesh.positions[a]) + glm::dvec3(mesh.positions[b]) +
                               glm::dvec3(mesh.positions[c])) /
                              3.0;
    const glm::dvec3 way = mesh.origin + middle - at.position;
    return way * baked_step(glm::length(way), radius);
  }

  const RayScene& scene;
  const DirectLight& light;
  LightSampling sampling;
  glm::uvec2 size;
  unsigned side;
  float radius, lift;
  Mesh flat;
  RayScene flat_rays;
  std::vector<glm::ivec2> offsets;
  std::size_t row_bytes;
  std::vector<std::uint8_t> covers;  // a bit for each texel whose middle is in a triangle
  std::atomic<std::uint64_t> covered = 0;
};

TextureView::TextureView(const RayScene& scene, const DirectLight& light,
                         const LightSampling& sampling, glm::uvec2 size, unsigned side,
                         float radius, float lift, const TextureTarget& target,
                         const TextureTile& tile, const Executor& executor) {
  constexpr unsigned kMaxMargin = 64;
  require_request(target.margin <= kMaxMargin, "texture.margin",
                  "`texture.margin` is above 64 texels");
  require_request(!scene.mesh().uvs.empty(), "meshes",
                  "the meshes have no texture coordinates, which a texture needs");
  impl_ = std::make_unique<Impl>(scene, light, sampling, size, side, radius, lift, target, tile,
                                 executor);
}

TextureView::~TextureView() = default;

std::optional<PrimaryHit> TextureView::at(unsigned x, unsigned y) const {
  const glm::dvec2 place = (glm::dvec2(x, y) + 0.5) / static_cast<double>(impl_->side);
  std::optional<TriangleHit> found = impl_->find(place);
  const bool is_margin = !found;
  if (is_margin) {
    const glm::ivec2 texel(place);
    const auto nearest = std::ranges::find_if(impl_->offsets, [&](const glm::ivec2& offset) {
      return impl_->is_covered(texel + offset);
    });
    if (nearest == impl_->offsets.end()) return std::nullopt;
    found = impl_->find(glm::dvec2(texel + *nearest) + 0.5);
  }
  const SurfaceHit surface = impl_->scene.surface(found->triangle, found->u, found->v);
  PrimaryHit hit = seen_of_mesh(impl_->scene, impl_->light, impl_->sampling, surface,
                                -surface.geometric_normal, impl_->lift, std::uint64_t{y} << 32 | x);
  hit.position += impl_->step_inwards(surface);
  hit.is_margin = is_margin;
  return hit;
}

std::uint64_t TextureView::bytes_for(const RayScene& scene, glm::uvec2 size) noexcept {
  return bytes_of(scene.mesh()) + scene.bytes() + std::uint64_t{(size.x + 7) / 8} * size.y;
}

std::uint64_t TextureView::bytes() const noexcept {
  return bytes_of(impl_->flat) + impl_->flat_rays.bytes() + impl_->covers.size();
}

double TextureView::covered() const noexcept {
  return static_cast<double>(impl_->covered) /
         (static_cast<double>(impl_->size.x) * static_cast<double>(impl_->size.y));
}

double TextureView::overlap() const noexcept {
  const Mesh& flat = impl_->flat;
  double area = 0;
  const glm::dvec2 high(impl_->size);
  for (const auto& corners : flat.triangles) {
    const glm::dvec2 a(flat.positions[corners[0]]), b(flat.positions[corners[1]]),
        c(flat.positions[corners[2]]);
    const glm::dvec2 middle = (a + b + c) / 3.0;
    if (middle.x < 0 || middle.y < 0 || middle.x >= high.x || middle.y >= high.y) continue;
    area += 0.5 * std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
  }
  return impl_->covered > 0 ? area / static_cast<double>(impl_->covered) : 0;
}

}  // namespace ptc
