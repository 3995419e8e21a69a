#include "engine/pipeline/render/surface_ids.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <span>
#include <utility>

#include <nlohmann/json.hpp>

namespace ptc {
namespace {

/// Returns names by their numbers as JSON. Names that occur again get numbers of their own.
std::string names_json(const std::vector<std::string>& names) {
  std::map<std::string, std::size_t> times;
  std::set<std::string> taken;
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < std::min(names.size(), SurfaceIds::kMaxNames); ++i) {
    std::string name = names[i];
    std::size_t& count = times[name];
    for (++count; count > 1 || taken.contains(name); ++count) {
      name = names[i] + "#" + std::to_string(std::max<std::size_t>(count, 2));
      if (!taken.contains(name)) break;
    }
    taken.insert(name);
    json[std::to_string(i + 1)] = name;
  }
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// Returns the name of a material with the file that defines it.
std::string label_of(const Material& material) {
  const std::string file = std::filesystem::path(material.file).filename().string();
  if (file.empty() || material.name.empty()) return file + material.name;
  return file + ":" + material.name;
}

}  // namespace

SurfaceIds::SurfaceIds(const Mesh& mesh) : mesh_(&mesh) {
  std::map<std::pair<std::string, std::string>, std::uint32_t> numbers;  // by file and name
  std::vector<std::string> materials;
  for (const Material& material : mesh.materials) {
    const auto [at, is_new] = numbers.try_emplace({material.file, material.name},
                                                  static_cast<std::uint32_t>(materials.size() + 1));
    if (is_new) materials.push_back(label_of(material));
    material_of_.push_back(at->second);
  }
  text_["ptcx/objectNames"] =
      names_json(mesh.objects.empty() ? std::vector<std::string>{""} : mesh.objects);
  text_["ptcx/materialNames"] = names_json(materials);
}

SurfaceId SurfaceIds::at(std::uint32_t triangle) const noexcept {
  std::uint32_t object = 0;
  if (!mesh_->object_runs.empty()) {
    const auto after =
        std::ranges::upper_bound(mesh_->object_runs, triangle, {}, &ObjectRun::first);
    object = std::prev(after)->object;
  }
  return {std::min(object + 1, kMaxId), material_of_[mesh_->material_of[triangle]]};
}

std::uint64_t SurfaceIds::bytes() const noexcept {
  std::uint64_t bytes = material_of_.size() * sizeof(material_of_[0]);
  for (const auto& [name, value] : text_) bytes += name.size() + value.size();
  return bytes;
}

void IdVotes::begin(std::size_t pixels, unsigned samples) {
  slots_ = std::min(samples, kMaxSlots);
  votes_.assign(pixels * slots_, {});
}

void IdVotes::add(std::size_t pixel, std::uint32_t id) {
  const auto slots = std::span(votes_).subspan(pixel * slots_, slots_);
  const auto slot =
      std::ranges::find_if(slots, [id](const Slot& s) { return s.id == id || s.id == 0; });
  if (slot == slots.end()) return;
  slot->id = id;
  ++slot->count;
}

std::uint32_t IdVotes::winner(std::size_t pixel) const {
  Slot best;
  for (const Slot& slot : std::span(votes_).subspan(pixel * slots_, slots_)) {
    if (slot.count > best.count || (slot.count == best.count && slot.id < best.id)) best = slot;
  }
  return best.id;
}

}  // namespace ptc
