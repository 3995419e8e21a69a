#include "engine/pipeline/stages.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/disk_space.h"
#include "engine/io/file/file.h"

namespace ptc {
namespace {

constexpr std::uint64_t kLeastCache = 16 << 20;

}  // namespace

Stage::Stage(StageSeconds& seconds, Progress& progress, std::string name, std::uint64_t total,
             const char* unit)
    : seconds_(seconds), progress_(progress), name_(std::move(name)) {
  seconds_.reserve(seconds_.size() + 1);
  progress_.begin(name_, total, unit);
}

// May run for want of memory: the row has its room, and a report that cannot be made is left out.
Stage::~Stage() {
  try {
    progress_.end();
  } catch (const std::bad_alloc&) {
  }
  seconds_.emplace_back(
      std::move(name_),
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count());
}

std::uint64_t memory_left(const RunOptions& run, std::uint64_t taken, std::uint64_t least,
                          const char* what_for) {
  if (run.memory_bytes < taken || run.memory_bytes - taken < least) {
    const std::uint64_t mebibytes = (taken + least + (1 << 20) - 1) >> 20;
    throw LimitError("the memory cap is too small for " + std::string(what_for) +
                     ": the least that works is " + std::to_string(mebibytes) + "M");
  }
  return run.memory_bytes - taken;
}

std::uint64_t cache_bytes_left(const RunOptions& run, std::uint64_t taken,
                               const ContainerReader& scene, unsigned threads, BackEnd back_end,
                               const char* what_for) {
  const std::uint64_t least =
      std::max(kLeastCache, PageCache::least_bytes(scene, threads, back_end));
  return memory_left(run, taken + open_bytes(scene) + threads * kGatherBytes, least, what_for);
}

std::uint64_t open_bytes(const ContainerReader& container) noexcept {
  return ContainerReader::kPageBytes * container.page_count();
}

void check_damage_request(bool tolerate, unsigned bounces, const std::optional<double>& error,
                          const CheckRequest& check) {
  if (!tolerate) return;
  if (bounces > 1) {
    throw std::invalid_argument(
        "--tolerate-damage goes with one bounce: more need every point, so salvage the scene "
        "first");
  }
  if (error || check.receivers > 0) {
    throw std::invalid_argument(
        "--tolerate-damage goes without --error and --check: rays need every point, so salvage the "
        "scene first");
  }
}

DamageReport damage_report(const ContainerReader& scene, const LostPages& lost,
                           const DamageCounts& stand_ins) {
  DamageReport report{.pages = lost.list(), .stand_ins = stand_ins};
  for (const auto& [page, why] : report.pages) {
    const DirectoryEntry& entry = scene.entry(page);
    if (entry.type == PageType::point) report.points += entry.record_count;
    if (entry.type == PageType::node) ++report.node_pages;
  }
  return report;
}

std::vector<std::filesystem::path> temp_dirs(const RunOptions& run,
                                             const std::filesystem::path& target) {
  if (!run.temp_dirs.empty()) return run.temp_dirs;
  return {directory_of(target)};
}

std::filesystem::path roomiest_temp_dir(const RunOptions& run,
                                        const std::filesystem::path& target) {
  return roomiest(temp_dirs(run, target));
}

std::unique_ptr<ContainerReader> make_temporary(
    const std::filesystem::path& directory,
    const std::function<void(const std::filesystem::path&)>& write) {
  static std::atomic<unsigned> made = 0;
  const std::filesystem::path path = directory / fmt::format(".ptcx-{}-{}.ptcx", getpid(), ++made);
  const TemporaryName name(path);  // before: write() may fail when the file is there already
  write(path);
  return std::make_unique<ContainerReader>(path);
}

LightRig recorded_lights(const ContainerReader& container) {
  const auto& text = container.meta().text;
  const auto found = text.find(kLightsKey);
  return found == text.end() ? LightRig{} : light_rig_from_json(found->second);
}

bool lit_by_emitters(const ContainerReader& container) {
  return container.meta().text.contains(kEmittersKey);
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

std::uint64_t mesh_bytes(const Mesh& mesh, const RayScene* rays) {
  return mesh.triangles.size() * (sizeof(mesh.triangles[0]) + sizeof(mesh.material_of[0])) +
         mesh.positions.size() * (2 * sizeof(glm::vec3) + sizeof(glm::vec2)) +
         (rays ? rays->bytes() : 0);
}

Receiver lifted(const Surfel& surfel, float lift) {
  return {surfel.position + glm::dvec3(surfel.normal) * static_cast<double>(lift * surfel.radius),
          surfel.normal};
}

std::function<glm::vec3(const glm::vec3&)> sky_function(const Sky& sky) {
  if (sky.radiance == glm::vec3(0)) return {};
  return [sky](const glm::vec3& direction) { return sky.at(direction); };
}

}  // namespace ptc
