// What the texels of a texture show of the surface that it covers, for baking.
#pragma once

#include <cstdint>
#include <memory>

#include <glm/vec2.hpp>

#include "engine/base/executor.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/texture_tiles.h"

namespace ptc {

/// How a texture covers a mesh.
struct TextureTarget {
  /// Texels around what is covered that show the nearest covered texel, so that filters do not
  /// bring in black. 0 to 64.
  unsigned margin = 8;
};

/// The surface that a texture covers, seen along its normals.
///
///     texture                   mesh
///     +-----------------+
///     |   ___     ____  |          ___ /|      A sample of a texel lies in a triangle of texture
///     |  / x \   |    | |         / x \ |      coordinates, and so at a place of the mesh. Where
///     | /_____\  |____| |        /_____\|      none holds it, the nearest texel that is covered
///     +-----------------+                      gives its own place, up to a margin.
///
/// Where triangles overlap in the texture, one of them is shown.
/// Memory: bytes().   Threads: at() may be called concurrently.
class TextureView : public PrimaryView {
 public:
  /// @param scene, light  of a mesh with texture coordinates; must outlive the view
  /// @param size    width and height of the texture, texels
  /// @param side    samples along the side of a texel
  /// @param radius  of the surfels, scene units, by which receivers step inside (baked_step())
  /// @param lift    height of receivers above the mesh, scene units
  /// @throws RequestError when the mesh has no texture coordinates
  TextureView(const RayScene& scene, const DirectLight& light, const LightSampling& sampling,
              glm::uvec2 size, unsigned side, float radius, float lift, const TextureTarget& target,
              const TextureTile& tile, const Executor& executor);
  ~TextureView() override;

  [[nodiscard]] std::optional<PrimaryHit> at(unsigned x, unsigned y) const override;

  /// Returns the bytes that a view will take beside the mesh and its rays, about.
  [[nodiscard]] static std::uint64_t bytes_for(const RayScene& scene, glm::uvec2 size) noexcept;
  /// Returns the bytes that the view takes beside the mesh and its rays.
  [[nodiscard]] std::uint64_t bytes() const noexcept;
  /// Returns the share of the texels that show a surface themselves, 0 to 1.
  [[nodiscard]] double covered() const noexcept;
  /// Returns the area of all triangles in the texture over that of the texels that they cover. It
  /// is about 1 where no two overlap.
  [[nodiscard]] double overlap() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
