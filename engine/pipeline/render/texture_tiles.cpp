#include "engine/pipeline/render/texture_tiles.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/pipeline/light/group_scenes.h"

namespace ptc {
namespace {

constexpr unsigned kTilesAlong = 10, kTilesUp = 100;  // that have numbers

/// Returns the targets of a tile: its number takes the place of kTileMark.
std::vector<PictureTarget> targets_of(std::span<const PictureTarget> targets,
                                      const TextureTile& tile) {
  std::vector<PictureTarget> named(targets.begin(), targets.end());
  for (PictureTarget& target : named) {
    std::string name = target.path.string();
    if (const std::size_t at = name.find(kTileMark); at != std::string::npos)
      target.path = name.replace(at, kTileMark.size(), std::to_string(tile.number()));
  }
  return named;
}

}  // namespace

std::vector<TextureTile> texture_tiles(const Mesh& mesh) {
  std::set<std::pair<unsigned, unsigned>> found;  // v, u: by number
  for (const auto& corners : mesh.triangles) {
    if (mesh.uvs.empty()) break;
    const glm::vec2 middle =
        (mesh.uvs[corners[0]] + mesh.uvs[corners[1]] + mesh.uvs[corners[2]]) / 3.0F;
    if (middle.x >= 0 && middle.y >= 0 && middle.x < kTilesAlong && middle.y < kTilesUp)
      found.emplace(static_cast<unsigned>(middle.y), static_cast<unsigned>(middle.x));
  }
  std::vector<TextureTile> tiles;
  for (const auto& [v, u] : found) tiles.push_back({{u, v}});
  return tiles;
}

LightingReport bake_tiles(std::span<const TextureTile> tiles,
                          std::span<const PictureTarget> targets, const BakeTile& bake,
                          Progress& progress) {
  const auto names = std::ranges::count_if(targets, [](const PictureTarget& target) {
    return target.path.string().find(kTileMark) != std::string::npos;
  });
  const bool marked = names > 0;
  if (marked && names != std::ssize(targets)) {
    throw RequestError("targets",
                       fmt::format("the names of all outputs hold {}, or none does", kTileMark));
  }
  if (marked && tiles.empty()) {
    throw RequestError("targets", fmt::format("no triangle lies in a tile that has a number, so "
                                              "that {} stands for nothing",
                                              kTileMark));
  }
  if (!marked) {
    if (tiles.size() > 1 || (!tiles.empty() && tiles.front().number() != TextureTile{}.number())) {
      progress.note(
          fmt::format("the texture coordinates lie in {} tile{}, and this is 1001: {} in the name "
                      "of each output stands for their numbers",
                      tiles.size(), tiles.size() == 1 ? "" : "s", kTileMark));
    }
    return bake(targets, {});
  }
  LightingReport report;
  for (const TextureTile& tile : tiles) add_run(report, bake(targets_of(targets, tile), tile));
  return report;
}

}  // namespace ptc
