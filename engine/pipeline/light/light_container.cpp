// Points are read in Z-order, lit in batches and written in the same order. Pages of channels are
// copied as they are stored: they belong to points by number, and no point changes its number.
#include "engine/pipeline/light/light_container.h"

#include <algorithm>
#include <array>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/io/cloud/record.h"
#include "engine/octree/build_pages.h"
#include "engine/octree/rounding.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/append.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/light/built_scene.h"
#include "engine/pipeline/light/disc_light.h"
#include "engine/pipeline/light/relit_points.h"
#include "engine/pipeline/parts/part_edges.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/shading_channels.h"
#include "engine/scene/light/sky_map.h"
#include "engine/shade/lift.h"
#include "engine/shade/shader.h"
#include "engine/store/attribute_rows.h"
#include "engine/store/commit.h"
#include "engine/store/writer.h"
#include "engine/trace/disc_visibility.h"
#include "format/scalar.h"

namespace ptc {
namespace {

/// How far receivers rise above the points of a container, in their order.
class Rises {
 public:
  explicit Rises(const ContainerReader& container)
      : container_(container),
        rows_(container, rise_groups(container.meta().channels)),
        rise_(rows_.channels()) {}

  /// Returns the rise of a point, in radii; 0 without the channel. Points are asked for in order.
  [[nodiscard]] float radii(std::uint64_t point) {
    if (rows_.row_bytes() == 0) return 0;
    while (point - first_ >= count()) {
      first_ += count();
      ++page_;
    }
    return rise_.radii(rows_.read(page_, count()).data() + (point - first_) * rows_.row_bytes());
  }

 private:
  [[nodiscard]] std::uint32_t count() const {
    return container_.entry(container_.point_pages()[page_]).record_count;
  }

  const ContainerReader& container_;
  AttributeRows rows_;
  RisePlace rise_;
  std::size_t page_ = 0;     // that held the last point
  std::uint64_t first_ = 0;  // number of its first point
};

/// The points of a scene with the light of a rig in place of their own.
class LitPoints : public RelitPoints {
 public:
  /// @param sky  null: the sky is black
  LitPoints(const ContainerReader& scene, const PointRange& range, DiscLight* lights, Shader* sky,
            const LightRequest& request, LightReport& report, Progress& progress)
      : RelitPoints(scene, range, progress),
        frame_(scene.header().frame),
        rises_(scene),
        lights_(lights),
        sky_(sky),
        lift_(request.lift),
        emission_(request.emission),
        report_(report),
        surfels_(kBatch),
        receivers_(sky ? kBatch : 0),
        heights_(kBatch),
        direct_(kBatch),
        shading_(sky ? kBatch : 0) {
    static_assert(kBatch % DiscLight::kBlock == 0);
  }

 private:
  void relight(std::span<PointRecord> records, std::uint64_t first) override {
    // Place the receivers
    const std::size_t count = records.size();
    for (std::size_t i = 0; i < count; ++i) {
      surfels_[i] = to_surfel(records[i], frame_);
      const float lift = std::max(lift_, rises_.radii(first + i));
      heights_[i] = lift_height(surfels_[i].radius, lift, frame_);
      direct_[i] = glm::vec3(0);
      if (sky_) receivers_[i] = lifted(surfels_[i], lift, frame_);
    }
    // Light them
    const double begin = ptc::cpu_seconds();
    if (lights_) {
      lights_->irradiance(std::span(surfels_).first(count), std::span(heights_).first(count), first,
                          std::span(direct_).first(count));
    }
    const double middle = ptc::cpu_seconds();
    report_.ray_cpu_seconds += middle - begin;
    Progress silent;
    if (sky_) {
      sky_->shade(std::span(receivers_).first(count), std::span(shading_).first(count), silent);
      report_.sky_cpu_seconds += ptc::cpu_seconds() - middle;
    }
    // Set what they reflect
    for (std::size_t i = 0; i < count; ++i) {
      PointRecord& record = records[i];
      if (!emission_) record.emission = {};
      const glm::vec3 light = direct_[i] + (sky_ ? shading_[i].sky : glm::vec3(0));
      for (int c = 0; c < 3; ++c) {
        const float reflects = static_cast<float>(record.albedo[static_cast<std::size_t>(c)]) *
                               (std::numbers::inv_pi_v<float> / 255);
        record.radiance[static_cast<std::size_t>(c)] =
            encode_half(reflects * std::max(0.0F, light[c]));
      }
    }
  }

  Frame frame_;
  Rises rises_;
  DiscLight* lights_;
  Shader* sky_;
  float lift_;
  bool emission_;
  LightReport& report_;
  std::vector<Surfel> surfels_;
  std::vector<Receiver> receivers_;
  std::vector<float> heights_;
  std::vector<glm::vec3> direct_;
  std::vector<Shading> shading_;
};

/// Returns the record of a scene that these lights lit.
Meta lit_meta(const ContainerReader& scene, const LightRig& rig, bool emitters) {
  Meta meta = scene.meta();
  std::erase_if(meta.channels,
                [&](const Channel& c) { return holds_shading(scene.meta().channels, c.group); });
  meta.text.erase("shading");
  meta.text.erase(kSkyLightKey);
  meta.text.erase(kEmittersKey);
  meta.text[kLightsKey] = lights_record(rig);
  if (emitters) meta.text[kEmittersKey] = "baked";
  return meta;
}

/// Copies the pages of all channels but those of a shading.
void copy_channels(const ContainerReader& from, ContainerWriter& writer) {
  std::vector<std::byte> stored;
  for (std::uint32_t page = 0; page < from.meta_page(); ++page) {
    const DirectoryEntry& entry = from.entry(page);
    if (entry.type != PageType::attribute || holds_shading(from.meta().channels, entry.group))
      continue;
    const std::uint32_t rank = writer.reserve_page(entry.type, entry.group);
    if (entry.is_void()) {
      writer.write_void_page({.type = entry.type,
                              .group = entry.group,
                              .rank = rank,
                              .record_count = entry.record_count});
      continue;
    }
    const PageHeader header = from.read_stored_page(page, stored);
    writer.write_stored_page(summary_of(header), header.coding, header.raw_bytes, stored);
  }
}

/// @param from  the file that is copied
void check_scene(const ContainerReader& from, const Meta& meta) {
  at_offset(from.file(), 0, [&] { check_copyable(from.header()); });
  if (!from.parts().empty()) {
    throw DataError(from.path().string() +
                    ": the surfels of a scene of parts cannot be lit as one: light its parts by "
                    "ptcfarm, or make it one file first with ptcconvert");
  }
  check_meta(meta, from.header().page_shift, from.header().point_bytes);
}

Uuid lit_uuid(const ContainerReader& scene, const LightRequest& request, const std::string& rig) {
  const GatherOptions& g = request.gather;
  std::string text(reinterpret_cast<const char*>(scene.header().uuid.data()), sizeof(Uuid));
  text += fmt::format("lit {} {} {} {} {} {} {} {} {} {}", g.solid_angle, g.parallax, g.inflation,
                      g.resolution, static_cast<int>(g.sides), request.lift,
                      request.light_sampling.sun_rays, request.light_sampling.area_rays,
                      request.emission, rig);
  return uuid_of(std::as_bytes(std::span(text)));
}

/// Lights the points of a container, or those of one part of it.
LightReport light_points(const LightRequest& request, std::optional<std::size_t> part,
                         const std::filesystem::path& target, Progress& progress) {
  // Open the scene, and choose the lights
  LightReport report;
  const ContainerReader scene(with_directory_under(request.scene, request.run));
  const LightRig rig = normalised(
      request.lights ? *request.lights : recorded_lights(scene, request.run, target, progress));
  const ContainerReader& from = part ? *scene.parts()[*part] : scene;
  const Meta planned = lit_meta(from, rig, true);
  check_scene(from, planned);
  if (planned.channels.size() < from.meta().channels.size())
    progress.note(
        "the channels of an earlier shading are left out, because they are of other light");

  const std::uint64_t emitting =
      request.emission && request.light_sampling.area_rays > 0 ? count_emitting(scene).count : 0;
  report.emitters = 2 * emitting;
  if (!request.lights && emitting == 0 && light_groups(rig, false).empty()) {
    throw RequestError("lights", scene.path().string() +
                                     ": no light is given, the scene records none, and nothing "
                                     "emits: give a light");
  }

  // Divide the memory among as many threads as it allows, and collect what emits
  const auto sky = sky_function(smooth_sky(rig.sky));
  const bool by_rays = emitting > 0 || has_lamps(rig);
  const auto lights_with = [&](unsigned threads) {
    return threads * ((by_rays ? 1U : 0U) + (sky ? 1U : 0U));
  };
  const auto readers_with = [&](unsigned threads) {
    return lights_with(threads) + (sky ? threads : 0);
  };
  const auto cache_bytes_with = [&](unsigned threads) {
    MemoryBudget budget = budget_of(request.run.memory_bytes, "lighting");
    budget.charge("emitters", kEmitterBytes * report.emitters);
    charge_sky(budget, rig.sky);
    if (rig.sky.map) budget.charge("the sky as it is gathered", smooth_sky_bytes());
    budget.charge(
        "the output's directory",
        ContainerWriter::memory_bytes(from.page_count(), scene.header().page_shift, threads) +
            held_pages_bytes(scene.header().page_shift));
    if (by_rays) {
      budget.charge("shadow rays", threads * DiscLight::thread_bytes(rig, request.light_sampling,
                                                                     DiscLight::kCellPlaces));
    }
    budget.require();
    if (readers_with(threads) == 0) return std::uint64_t{0};
    return cache_bytes_left(std::move(budget), scene, lights_with(threads), readers_with(threads),
                            request.back_end);
  };
  const auto [threads, cache_bytes] = threads_that_fit(request.run, cache_bytes_with);
  const ThreadPool executor(threads);
  std::unique_ptr<PageCache> cache;
  if (const unsigned readers = readers_with(threads); readers > 0) {
    cache = std::make_unique<PageCache>(
        scene, CacheOptions{
                   .memory_bytes = cache_bytes, .threads = readers, .back_end = request.back_end});
  }

  const LightRays rays = rays_at_lights(scene, rig, request.lift, emitting);

  // Light all points into the target
  const SceneView view(scene);
  std::unique_ptr<DiscLight> lights;
  std::unique_ptr<Shader> shader;
  if (by_rays) {
    lights = std::make_unique<DiscLight>(view, *cache, rays, request.light_sampling,
                                         DiscLight::kCellPlaces, request.gather.sides, executor);
  }
  if (sky) {
    ShadeOptions shade{.gather = request.gather,
                       .sky = sky,
                       .cache = cache.get(),
                       .visibility = disc_visibility(request.gather.sides)};
    shade.gather.bleeding = false;
    shader = std::make_unique<Shader>(scene, shade, executor);
  }
  BuildRequest like;
  adopt_profile(like, from);
  const PointRange range = points_of(scene, part);
  {
    const Stage stage(report.seconds, progress, "light", range.count(), "points");
    LitPoints points(scene, range, lights.get(), shader.get(), request, report, progress);
    const std::unique_ptr<PointStream> rounded =
        is_rounded(like.profile) ? round_points(points, scene.header().frame.unit(), executor)
                                 : nullptr;
    PointStream& last = rounded ? *rounded : static_cast<PointStream&>(points);
    const InputFile* replaces = part ? nullptr : &scene.file();
    ContainerWriter writer(target, {.page_shift = scene.header().page_shift,
                                    .codec = codec_of(like.profile),
                                    .uuid = lit_uuid(from, request, planned.text.at(kLightsKey)),
                                    .frame = scene.header().frame,
                                    .point_bytes = scene.header().point_bytes,
                                    .source = request.replaces ? request.replaces : replaces});
    Progress silent;
    TreeEdges edges;
    const BuildOptions tree{.leaf_points = std::max(1U, scene.superblock().leaf_points)};
    const Superblock made =
        build_pages(last, writer, tree, executor, silent, {}, part ? &edges : nullptr);
    copy_channels(from, writer);
    writer.finish(lit_meta(from, rig, report.emitters > 0), made);
    if (part) write_edges(target, edges);
  }
  report.points = range.count();
  if (lights) report.rays = lights->rays();
  if (shader) report.gather = shader->counts();
  lights.reset();
  shader.reset();
  if (cache) report.cache = cache->statistics();
  return report;
}

}  // namespace

LightReport light_container(const LightRequest& request, const std::filesystem::path& target,
                            Progress& progress) {
  check_ranges(request);
  if (request.lights) check_lights(*request.lights);
  if (is_container_alone(request)) return light_points(request, {}, target, progress);
  // Build a temporary container of clouds and meshes, without light, unless the inputs say which
  std::optional<LightRig> unlit;
  if (request.lights) unlit.emplace();
  const BuiltScene scene(request, {.lights = unlit, .note_lost_records = true}, target, progress);
  LightRequest lighting = request;
  lighting.scene = scene.path();
  lighting.joined.clear();
  LightReport report = light_points(lighting, {}, target, progress);
  scene.add_stages(report.seconds);
  return report;
}

LightReport light_part(const LightRequest& request, std::size_t part,
                       const std::filesystem::path& target, Progress& progress) {
  check_ranges(request);
  if (request.lights) check_lights(*request.lights);
  return light_points(request, part, target, progress);
}

}  // namespace ptc
