// Every group gives a container of the same points in the same order, so that they are read side by
// side:
//
//   scene of key    ---- shaded ---->  occlusion, irradiance, sky --+
//   scene of fill   ---- shaded ---->  occlusion, irradiance, sky --+--->  sums, and light_key, ...
//   scene of all lamps: the points' own light ----------------------+
#include "engine/pipeline/shade/shaded_groups.h"

#include <cassert>
#include <cstring>
#include <deque>
#include <memory>
#include <numbers>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/cloud/record.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/pipeline/light/group_scenes.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/shaded_sink.h"
#include "engine/pipeline/temporary_container.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = 4096;  // points in memory at once

/// Reads the shaded points of one group.
class ShadedGroup {
 public:
  ShadedGroup(std::unique_ptr<ContainerReader> shaded, bool rest)
      : shaded_(std::move(shaded)),
        rest_(rest),
        points_(*shaded_, {.groups = std::vector<std::uint8_t>{kShadingGroup}}) {}

  [[nodiscard]] const ContainerReader& container() const { return *shaded_; }
  /// The radiance of points as the container holds it, and of the rest what they emit.
  [[nodiscard]] glm::vec3 own(std::size_t i) const {
    return rest_ ? surfels_[i].outgoing() : surfels_[i].radiance;
  }
  [[nodiscard]] const glm::vec3& albedo(std::size_t i) const { return surfels_[i].albedo; }

  /// Reads the next points. @return their results; empty at the end
  std::span<const Shading> next() {
    surfels_.resize(kBlock);
    shading_.resize(points_.next(surfels_));
    const std::byte* value = points_.attributes().data();
    const auto take = [&] {
      std::uint16_t half = 0;
      std::memcpy(&half, value, sizeof half);
      value += sizeof half;
      return decode_half(half);
    };
    const auto take_vector = [&] {
      const float x = take(), y = take();
      return glm::vec3(x, y, take());
    };
    for (Shading& s : shading_) {  // in the order of shading_channels()
      s.occlusion = take();
      s.bent_normal = take_vector();
      s.irradiance = take_vector();
      s.sky = take_vector();
      take_vector();  // what leaves follows from the two before it
    }
    return shading_;
  }

 private:
  std::unique_ptr<ContainerReader> shaded_;
  bool rest_;
  ContainerSource points_;
  std::vector<Surfel> surfels_;
  std::vector<Shading> shading_;
};

/// Adds the groups up, point by point.
/// @param base  container of the points, in the order of the groups
/// @param own   whether they are the scene's own, whose radiance counts
void add_up(const ContainerReader& base, std::deque<ShadedGroup>& groups, bool own,
            ShadedSink& sink, Progress& progress) {
  std::vector<std::uint8_t> kept(base.groups().begin(), base.groups().end());
  std::erase_if(kept, [&](std::uint8_t g) { return holds_shading(base.meta().channels, g); });
  ContainerSource points(base, {.groups = kept});
  std::vector<Surfel> surfels(kBlock);
  std::vector<Shading> sums;
  std::vector<glm::vec3> lights;
  while (const std::size_t count = points.next(surfels)) {
    lights.resize(count * groups.size());
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const std::span<const Shading> shading = groups[g].next();
      assert(shading.size() == count);
      if (g == 0) sums.assign(shading.begin(), shading.end());
      for (std::size_t i = 0; i < count; ++i) {
        const Shading& s = shading[i];
        if (g > 0) {
          sums[i].irradiance += s.irradiance;
          sums[i].sky += s.sky;
        }
        // What the scene's own points reflect of the sky is in their own light
        const glm::vec3 arrives = own ? s.irradiance : s.irradiance + s.sky;
        lights[i * groups.size() + g] =
            groups[g].albedo(i) * arrives * std::numbers::inv_pi_v<float> +
            (own ? groups[g].own(i) : glm::vec3(0));
      }
    }
    sink.write(std::span(surfels).first(count), points.attributes(), {.shading = sums}, lights);
    progress.advance(count);
  }
}

}  // namespace

LightingReport shade_groups(
    const ShadeRequest& request, const std::filesystem::path& target, const std::string& settings,
    const std::string& las_records,
    const std::function<LightingReport(const ShadeRequest&, const std::filesystem::path&)>& shade,
    Progress& progress) {
  require_request(request.count == 0, "count",
                  "`light_groups` excludes `count`: all points are shaded");
  require_request(!request.sky, "sky",
                  "`light_groups` excludes `sky`: the sky is one of the lights that are in groups");
  const std::filesystem::path directory = roomiest_temp_dir(request.run, target);
  const ContainerReader scene(with_directory_under(request.scene, request.run));
  const LightRig rig = recorded_lights(scene, request.run, target, progress);
  const bool own = request.receivers.empty();
  LightingReport report;
  Progress silent;

  // Shade the receivers under the lights of each group
  const ShadedExtras extras{.groups = groups_of(request, rig, may_emit(scene))};
  if (own) {
    check_shaded_sink(target, scene, extras);
  } else if (is_container(request.receivers)) {
    check_shaded_sink(target, ContainerReader(request.receivers), extras);
  }
  ShadeRequest one = request;  // with what the containers that are open leave of the memory
  one.light_groups = one.original_order = false;
  const auto hold = [&](const ContainerReader& container) {
    one.run.hold(ContainerReader::kPageBytes * container.page_count());
  };
  hold(scene);
  std::deque<ShadedGroup> groups;
  for (const std::string& group : extras.groups) {
    const bool rest = group.empty();
    one.scene = request.scene;
    const RelitScene lit(one, only_group(rig, group), rest, {}, target, report.seconds, silent);
    one.scene = lit.path();
    groups.emplace_back(make_temporary_container(directory,
                                                 [&](const std::filesystem::path& path) {
                                                   add_costs(report, shade(one, path));
                                                 }),
                        rest);
    hold(groups.back().container());
  }

  // Add them up
  std::unique_ptr<ContainerReader> lit;
  if (own) {
    one.scene = request.scene;
    const RelitScene all(one, rig, true, {}, target, report.seconds, silent);
    lit = std::make_unique<ContainerReader>(all.path());
  }
  const ContainerReader& base = own ? *lit : groups.front().container();
  MemoryBudget budget = budget_of(request.run.memory_bytes, "groups of lights");
  for (const ShadedGroup& group : groups) charge_directory(budget, group.container());
  budget.charge("the output's directory", sink_bytes(target, base, groups.size()));
  const std::uint64_t points = base.superblock().points;
  PointWriteInfo info =
      shaded_points(base, points, settings, request.colour_from, output_format(target));
  if (own && !las_records.empty()) info.text[kLasRecordsKey] = las_records;
  note_changed_values(target, info, progress);
  const std::unique_ptr<ShadedSink> sink = make_shaded_sink(target, base, info, extras);
  {
    const Stage stage(report.seconds, progress, "add up", points, "points");
    add_up(base, groups, own, *sink, progress);
  }
  sink->finish();
  return report;
}

}  // namespace ptc
