// Receivers are read in Z-order, shaded in batches and written in the same order. Pilots, which
// choose the settings, are some of the blocks of the same receivers:
//
//   receivers    |--------------------------------------------------------------------------|
//   pilots         |==|              |==|              |==|              |==|         tune()
//   batches      |--------|--------|--------|--------|--------|--------|--------|----- shade()
#include "engine/pipeline/shade/shade_container.h"

#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/cloud/points.h"
#include "engine/io/cloud/record.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/pipeline/light/built_scene.h"
#include "engine/pipeline/light/group_scenes.h"
#include "engine/pipeline/light/group_shadows.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/receivers.h"
#include "engine/pipeline/shade/shaded_groups.h"
#include "engine/pipeline/shade/shaded_sink.h"
#include "engine/pipeline/shade/shading_channels.h"
#include "engine/pipeline/temporary_container.h"
#include "engine/store/attribute_rows.h"
#include "engine/store/point_scan.h"

namespace ptc {
namespace {

ShadedExtras extras_of(const ShadeRequest& request) {
  return {.estimates = request.estimate,
          .glossy = request.glossy.roughness.has_value(),
          .shadows = request.shadows};
}

/// Returns the place from which mirrors are looked at.
glm::dvec3 eye_of(const ShadeRequest& request, const ContainerReader& scene) {
  if (!request.glossy.roughness) return glm::dvec3(0);
  return request.eye ? *request.eye : default_camera(scene, {}, {}, {}).position;
}

/// The open container of a request's receivers.
struct OpenReceivers {
  OpenReceivers(const ShadeRequest& request, const std::filesystem::path& target,
                const Lighting& lighting, Progress& progress)
      : other(open(request, target, progress, las_records)),
        container(other ? *other : lighting.scene()),
        wanted(selected_of(container, request.count)),
        lost(other ? nullptr : lighting.lost()),
        groups(groups_for(target)),
        points(lost ? count_whole() : wanted) {}

  [[nodiscard]] std::uint64_t all() const { return container.superblock().points; }
  [[nodiscard]] PointCursor cursor() const { return {container, groups, wanted, 0, lost}; }

  std::string las_records;                 ///< BuildReport::las_records of a cloud; `other` sets it
  std::unique_ptr<ContainerReader> other;  ///< null: the receivers are the scene's own points
  const ContainerReader& container;
  std::uint64_t wanted;              ///< number of points that were asked for
  LostPages* lost;                   ///< gets the damaged pages; null: damaged pages are errors
  std::vector<std::uint8_t> groups;  ///< of the channels that cursor() reads
  std::uint64_t points;              ///< number of wanted points that can be read

 private:
  /// Opens a container as it is; builds a cloud into a temporary one.
  static std::unique_ptr<ContainerReader> open(const ShadeRequest& request,
                                               const std::filesystem::path& target,
                                               Progress& progress, std::string& las_records) {
    if (request.receivers.empty()) return nullptr;
    if (is_container(request.receivers)) {
      return std::make_unique<ContainerReader>(
          with_directory_under(request.receivers, request.run));
    }
    const BuildRequest build{.inputs = {request.receivers},
                             .lights = LightRig{},  // receivers need no light of their own
                             .profile = Profile::raw,
                             .note_lost_records = !output_format(target),
                             .run = request.run};
    return make_temporary_container(
        roomiest_temp_dir(request.run, target), [&](const std::filesystem::path& path) {
          las_records = build_container(build, path, progress).las_records;
        });
  }

  /// Returns the groups that are needed: for a file of points all but those of an earlier shading;
  /// a container takes pages as they are, so the rises alone.
  [[nodiscard]] std::vector<std::uint8_t> groups_for(const std::filesystem::path& target) const {
    return output_format(target) ? groups_without_shading(container)
                                 : rise_groups(container.meta().channels);
  }

  [[nodiscard]] std::uint64_t count_whole() const {
    PointCursor points_left = cursor();
    std::vector<Surfel> block(Shader::kBlock);
    std::uint64_t count = 0;
    while (const std::size_t more = points_left.next(block)) count += more;
    return count;
  }
};

void check_target(const ShadeRequest& request, const std::filesystem::path& target) {
  if (output_format(target)) return;
  if (lower_extension(target) != ".ptcx") {
    throw RequestError("target",
                       "the name of the output must end in .ptcx or in that of a format of points, "
                       "such as .las or .ply, but is " +
                           target.string());
  }
  if (request.tolerate_damage && request.receivers.empty()) {
    throw RequestError("tolerate_damage",
                       "`tolerate_damage` needs a .ply as output: a copy of the container would "
                       "keep what is damaged. Name a .ply, or salvage the scene first");
  }
}

void check_count(const OpenReceivers& receivers, const std::filesystem::path& target) {
  if (receivers.wanted == receivers.all() || output_format(target)) return;
  throw RequestError("count",
                     "`count` needs a .ply as output: a container holds all points of the "
                     "receivers. Name a .ply, or shade all points");
}

/// Shades all receivers, batch by batch.
/// @param shadows  null: none are asked for
void shade_all(const OpenReceivers& receivers, float lift, Lighting& lighting, DiscShadows* shadows,
               ShadedSink& sink) {
  PointCursor cursor = receivers.cursor();
  const Lifting lifting(receivers.container.header().frame, cursor.channels(), lift);
  std::vector<Surfel> surfels(kReceiverBatch);
  std::vector<Receiver> batch(kReceiverBatch);
  std::vector<std::byte> rows;
  while (const std::size_t count = cursor.next(surfels, &rows)) {
    lifting.place(std::span(surfels).first(count), rows, batch);
    LitReceivers lit = lighting.shade(std::span(batch).first(count));
    if (shadows) lit.shadows = shadows->at(std::span(batch).first(count));
    sink.write(std::span(surfels).first(count), rows, lit, {});
  }
}

/// Shades the points of a container.
/// @param las_records  BuildReport::las_records of the scene; empty: what its container keeps
LightingReport shade_points(const ShadeRequest& request, const std::filesystem::path& target,
                            const std::string& las_records, Progress& progress) {
  check_target(request, target);
  if (request.light_groups) {
    const auto one = [&](const ShadeRequest& group, const std::filesystem::path& path) {
      return shade_points(group, path, "", progress);
    };
    return shade_groups(request, target, settings_text(request, request.gather, 0) + " groups",
                        las_records, one, progress);
  }
  // Open the scene and the receivers
  LightingReport report;
  if (request.sky) check_sky(*request.sky, "sky");
  Lighting lighting(request, report, progress);
  const OpenReceivers receivers(request, target, lighting, progress);
  check_count(receivers, target);
  const ShadedExtras extras = extras_of(request);
  check_shaded_sink(target, receivers.container, extras);
  const Sky sky = request.sky
                      ? *request.sky
                      : recorded_lights(lighting.scene(), request.run, target, progress).sky;
  const std::vector<LightRig> rigs =
      rigs_of_groups(recorded_rig(lighting.scene()), request.shadows);

  // Divide the memory, shade earlier bounces, choose the settings
  MemoryBudget budget = budget_of(request.run.memory_bytes, "shading");
  if (receivers.other) charge_directory(budget, *receivers.other);
  budget.charge("the output's directory",
                sink_bytes(target, receivers.container, later_channels(extras)));
  const unsigned threads = lighting.executor().threads();
  if (!rigs.empty()) {
    budget.charge("shadows", DiscShadows::bytes(lighting.scene(), rigs, threads, request.back_end));
  }
  // The light that lamps gave the scene's own points is in their radiance
  LampRays lamps{.emitters = receivers.other || !lit_by_emitters(lighting.scene())};
  if (receivers.other) lamps.rig = recorded_rig(lighting.scene());
  lighting.prepare(std::move(budget), sky, lamps, 1, eye_of(request, lighting.scene()), target);
  lighting.tune([&] { return pilots_of(receivers.container, receivers.points, request.lift); });

  // Shade all receivers into the target
  PointWriteInfo info =
      shaded_points(receivers.container, receivers.points,
                    settings_text(request, lighting.gather(), lighting.receiver_rays()),
                    request.colour_from, output_format(target));
  const std::string& records = receivers.other ? receivers.las_records : las_records;
  if (!records.empty()) info.text[kLasRecordsKey] = records;
  note_changed_values(target, info, progress);
  const std::unique_ptr<ShadedSink> sink =
      make_shaded_sink(target, receivers.container, info, extras);
  {
    const Stage stage(report.seconds, progress, "shade", receivers.points, "points");
    std::unique_ptr<DiscShadows> shadows;
    if (!rigs.empty()) {
      shadows = std::make_unique<DiscShadows>(lighting.scene(), rigs, request.gather.sides,
                                              request.back_end, lighting.executor());
    }
    shade_all(receivers, request.lift, lighting, shadows.get(), *sink);
  }
  lighting.finish();
  sink->finish();

  // Compare a sample of the receivers with rays
  lighting.check({});
  return report;
}

/// Shades into a temporary copy of the container, and writes its points in the order of the input.
/// @param las_records  as for shade_points()
LightingReport shade_in_input_order(const ShadeRequest& request,
                                    const std::filesystem::path& target,
                                    const std::string& las_records, Progress& progress) {
  if (!request.colour_from.empty()) {
    PointWriteInfo info =
        shaded_points(ContainerReader(with_directory_under(request.scene, request.run)), 0, "",
                      request.colour_from, std::nullopt);
    ShadedExtras extras = extras_of(request);
    if (request.light_groups) {
      const ContainerReader scene(with_directory_under(request.scene, request.run));
      extras.groups = groups_of(request, recorded_rig(scene), may_emit(scene));
    }
    const std::vector<Channel> added = shading_channels(extras);
    info.channels.insert(info.channels.end(), added.begin(), added.end());
    check_colour_from(output_format(target).value(), info);
  }
  LightingReport report;
  const std::unique_ptr<ContainerReader> shaded = make_temporary_container(
      roomiest_temp_dir(request.run, target), [&](const std::filesystem::path& path) {
        report = shade_points(request, path, las_records, progress);
      });
  const ConvertReport written = container_to_points(*shaded, target,
                                                    {.original_order = true,
                                                     .colour_from = request.colour_from,
                                                     .las_records = las_records,
                                                     .run = request.run},
                                                    progress);
  report.seconds.insert(report.seconds.end(), written.seconds.begin(), written.seconds.end());
  return report;
}

}  // namespace

LightingReport shade_container(const ShadeRequest& request, const std::filesystem::path& target,
                               Progress& progress) {
  if (is_container_alone(request)) {
    return request.original_order ? shade_in_input_order(request, target, "", progress)
                                  : shade_points(request, target, "", progress);
  }
  // Build a temporary container of clouds and meshes; points go out in the order in which they came
  const bool in_order = output_format(target).has_value() && request.receivers.empty() &&
                        request.count == 0 &&
                        std::ranges::all_of(object_files(scene_files(request)), holds_points);
  const BuiltScene scene(request,
                         {.original_order = in_order,
                          .profile = in_order ? Profile::exact : Profile::compact,
                          .note_lost_records = !output_format(target)},
                         target, progress);
  ShadeRequest shading = request;
  shading.scene = scene.path();
  shading.joined.clear();
  LightingReport report = in_order
                              ? shade_in_input_order(shading, target, scene.las_records(), progress)
                              : shade_points(shading, target, scene.las_records(), progress);
  scene.add_stages(report.seconds);
  return report;
}

}  // namespace ptc
