#include "engine/pipeline/scene_record.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/pipeline/budgets.h"

namespace ptc {

void join_texts(std::map<std::string, std::string>& text,
                std::map<std::string, std::string>& named_by,
                const std::map<std::string, std::string>& added, const std::string& other,
                Progress& progress) {
  const auto owner_of = [&](const char* key) {
    const auto found = named_by.find(key);
    return found == named_by.end() ? std::string("the scene") : found->second;
  };
  const auto compare = [&](const char* key, const char* what) {
    const auto was = text.find(key);
    const auto is = added.find(key);
    if (was == text.end() || is == added.end() || was->second == is->second) return;
    progress.note(other + ": its " + what + " is not that of " + owner_of(key) +
                  ", which is recorded; positions are taken as they are");
  };
  compare(kCrsKey, "coordinate reference system");
  compare(kUnitKey, "unit of length");
  compare(kUpKey, "upward axis");
  const auto is_placed = [](const std::map<std::string, std::string>& texts) {
    return texts.contains(kCrsKey) || texts.contains(kUnitKey);
  };
  const bool placed = is_placed(text);
  if (placed && !is_placed(added)) {
    progress.note(other + ": it names no coordinate reference system and no unit; those of " +
                  owner_of(text.contains(kCrsKey) ? kCrsKey : kUnitKey) + " are recorded for all");
  }
  for (const auto& [key, value] : added) {
    if (placed && (key == kCrsKey || key == kUnitKey)) continue;
    if (text.emplace(key, value).second) named_by.emplace(key, other);
  }
}

bool has_colours(const std::map<std::string, std::string>& text) {
  const auto found = text.find(kAlbedoKey);
  return found == text.end() || found->second != kAssumed;
}

glm::vec3 up_of(const std::map<std::string, std::string>& text) {
  const auto found = text.find(kUpKey);
  if (found != text.end() && found->second == "x") return {1, 0, 0};
  if (found != text.end() && found->second == "z") return {0, 0, 1};
  return {0, 1, 0};
}

LightRig recorded_rig(const ContainerReader& container) {
  const auto& text = container.meta().text;
  const auto found = text.find(kLightsKey);
  return found == text.end() ? LightRig() : light_rig_from_json(found->second);
}

LightRig recorded_lights(const ContainerReader& container, const RunOptions& run,
                         const std::filesystem::path& target, Progress& progress) {
  LightRig rig = recorded_rig(container);
  const std::string file = container.path().string();
  try {
    const auto store = texture_store(run, target);
    if (load_sky_map(rig.sky, directory_of(container.path()), *store) == SkyMap::changed) {
      progress.note(file + ": the sky picture " + rig.sky.map_path +
                    " has changed since it lit the scene's surfels");
    }
  } catch (const DataError& error) {
    throw DataError(file + ": " + error.what());
  }
  return rig;
}

std::string lights_record(LightRig rig) {
  if (rig.sky.map && rig.sky.map_path.empty()) {
    throw RequestError("lights",
                       "a sky with a picture needs its path, which the container records");
  }
  if (!rig.sky.map_path.empty()) {
    rig.sky.map_path = std::filesystem::absolute(rig.sky.map_path).lexically_normal().string();
  }
  return to_json(rig);
}

void check_page_shift(std::uint8_t page_shift) {
  require_request(page_shift >= 12 && page_shift <= 20, "page_shift",
                  "`page_shift` is not the logarithm of 4 KiB to 1 MiB, 12 to 20");
}

void check_meta(const Meta& meta, std::uint8_t page_shift, std::uint8_t point_bytes,
                std::size_t reserve) {
  check_page_shift(page_shift);
  const std::size_t bytes = encode_meta(meta, point_bytes).size() + reserve;
  const std::size_t most = payload_limit(page_shift);
  if (bytes <= most) return;
  throw RequestError("page_shift",
                     fmt::format("the record of lights, inputs and channels takes up to {} bytes, "
                                 "but a page holds {}: choose larger pages with `page_shift`",
                                 bytes, most));
}

bool lit_by_emitters(const ContainerReader& container) {
  return container.meta().text.contains(kEmittersKey);
}

bool may_emit(const ContainerReader& container) {
  return container.header().point_bytes != kPointBytes;
}

bool sky_is_gathered(const ContainerReader& container) {
  return container.meta().text.contains(kSkyLightKey);
}

double surfel_spacing(const ContainerReader& container) {
  const auto& text = container.meta().text;
  if (const auto found = text.find(kSpacingKey); found != text.end()) {
    const double spacing = std::strtod(found->second.c_str(), nullptr);
    if (std::isfinite(spacing) && spacing > 0) return spacing;
  }
  const Superblock& superblock = container.superblock();
  return superblock.points == 0
             ? 0
             : std::sqrt(superblock.area / static_cast<double>(superblock.points));
}

float surfel_radius(const ContainerReader& container) {
  return static_cast<float>(surfel_spacing(container) / std::numbers::sqrt2);
}

}  // namespace ptc
