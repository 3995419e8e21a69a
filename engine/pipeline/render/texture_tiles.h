// The tiles of a texture, each of which has files of its own (UDIM).
#pragma once

#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>

#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/render/picture_files.h"

namespace ptc {

/// A tile of the plane of texture coordinates, 1 x 1.
struct TextureTile {
  glm::uvec2 corner{0};  ///< texture coordinates of its low corner

  /// Returns the number by which files are named: 1001 for the tile from 0 to 1, 1 more for each
  /// tile along u, of which there are 10, and 10 more for each along v.
  [[nodiscard]] unsigned number() const noexcept { return 1001 + corner.x + 10 * corner.y; }
};

/// What stands for the number of a tile in the name of a texture.
inline constexpr std::string_view kTileMark = "<UDIM>";

/// Returns the tiles that the texture coordinates of a mesh lie in, by number. Coordinates outside
/// of the 10 x 100 tiles that have numbers are left out.
[[nodiscard]] std::vector<TextureTile> texture_tiles(const Mesh& mesh);

/// Bakes one tile into files.
using BakeTile =
    std::function<LightingReport(std::span<const PictureTarget> targets, const TextureTile& tile)>;

/// Bakes each tile, if the name of every target holds kTileMark, which its number replaces; else
/// that from 0 to 1 alone, with a note when there are others.
/// @param tiles  as texture_tiles() returns them
/// @return       the costs of all tiles, and the errors of all receivers that were checked
LightingReport bake_tiles(std::span<const TextureTile> tiles,
                          std::span<const PictureTarget> targets, const BakeTile& bake,
                          Progress& progress);

}  // namespace ptc
