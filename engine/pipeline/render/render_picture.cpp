#include "engine/pipeline/render/render_picture.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/light/built_scene.h"
#include "engine/pipeline/light/group_scenes.h"
#include "engine/pipeline/light/group_shadows.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/render/frame_cameras.h"
#include "engine/pipeline/render/picture_checks.h"
#include "engine/pipeline/render/picture_layers.h"
#include "engine/pipeline/render/shots.h"
#include "engine/pipeline/render/subject.h"
#include "engine/pipeline/render/tile_renderer.h"
#include "engine/pipeline/render/vertex_files.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/shading_channels.h"

namespace ptc {
namespace {

// Bytes of a pixel of a tile (hit, receiver, result, order), and of what estimates add to it
constexpr std::uint64_t kReceiverBytes = 344;
constexpr std::uint64_t kEstimateBytes = sizeof(Shading) + sizeof(ErrorEstimate);

/// What a run renders of a request.
struct PicturePart {
  bool emission = true;          ///< whether the meshes emit
  std::uint64_t held_bytes = 0;  ///< for each pixel, of the pictures of other parts
  TextureTile tile;              ///< that is baked, if it is a texture
  std::optional<Moment> moment;  ///< that is seen of a scene that moves
};

/// Returns a budget that is charged with everything that rendering takes besides the gather.
/// @param view  of the surfels, if the subject has no mesh
MemoryBudget picture_budget(const RenderRequest& request, std::span<const PictureTarget> targets,
                            const PicturePart& part, const Subject& subject,
                            const SurfelViewBytes& view) {
  MemoryBudget budget = budget_of(request.run.memory_bytes, "this picture");
  const bool glossy = request.glossy.roughness.has_value();
  const std::uint64_t receiver =
      kReceiverBytes + (request.estimate ? kEstimateBytes : 0) + (glossy ? sizeof(Reflection) : 0);
  budget.charge("a tile", TileRenderer::kSamplesAtOnce * receiver);
  const FilmExtras extras = extras_of(request, targets, subject.ids.has_value());
  if (subject.ids) {
    budget.charge("the names of objects", 3 * subject.ids->bytes());
    budget.charge("objects of a tile", TileRenderer::kSamplesAtOnce * 2 * IdVotes::kSlotBytes);
  }
  const ImageWindow& window = subject.window;
  const unsigned rows =
      std::min(window.height, TileRenderer::tile_of(window.width, subject.side).height);
  budget.charge("rows of the picture", Film::pixel_bytes(extras) * window.width * rows);
  if (part.held_bytes > 0) {
    budget.charge("the picture of all groups", subject.pixels() * part.held_bytes);
  } else {
    budget.charge("the files of the picture",
                  request.vertices ? VertexFiles::bytes(targets, subject.mesh)
                                   : PictureFiles::bytes(targets, window.width,
                                                         layer_types(Film(1, 1, extras))));
  }
  if (subject.rays) {
    charge_mesh(budget, subject.mesh, subject.rays.get());
    if (request.bakes()) budget.charge("the mesh as it is baked", subject.baked_bytes);
  } else {
    budget.charge("the depth buffer", view.depth);
    if (view.pages > 0) budget.charge("pages that the camera sees", view.pages);
  }
  return budget;
}

/// Gets complete rows of a picture of a subject, from the top down.
/// @param frame  index of the picture
using RowsSeen = std::function<void(const Film& rows, unsigned first, const Subject& subject,
                                    std::size_t frame)>;

/// Renders the pictures of a container.
LightingReport render_part(const RenderRequest& request, std::span<const PictureTarget> targets,
                           const PicturePart& part, Continuity& kept, const RowsSeen& done,
                           Progress& progress) {
  // Open the scene and load what the camera sees
  LightingReport report;
  Subject subject{.side = side_of(request.samples)};
  Lighting lighting(request, report, progress);
  const LightRig lights = request.lights ? *request.lights
                                         : recorded_lights(lighting.scene(), request.run,
                                                           targets.front().path, progress);
  check_names(request, targets, lights.sky.map_path);
  auto of_files = cameras_of_files(request, lighting.scene());
  load_subject(subject, request, part.moment, part.emission, lighting.scene(), lights.sky,
               targets.front().path, progress);
  if (has_ids(request, targets)) {
    require_ids(targets, subject.has_mesh());
    if (subject.has_mesh()) subject.ids.emplace(subject.mesh);
  }
  const std::vector<Camera> cameras =
      cameras_of_frames(request, lighting.scene(), of_files, subject, kept);
  of_files.reset();
  subject.camera = cameras.front();
  subject.window = window_of(request, subject.camera);
  SurfelViewBytes view;
  if (subject.has_mesh()) {
    trace_subject(subject, request, lighting, lights);
    see(subject, request, part.tile, view, lighting, progress);
  } else {
    view = surfel_view_bytes(subject, lighting, request.run.memory_bytes, cameras.size() > 1);
  }
  const std::vector<LightRig> rigs = rigs_of_groups(lights, request.shadows);

  // Divide the memory, shade earlier bounces, choose the settings
  MemoryBudget budget = picture_budget(request, targets, part, subject, view);
  budget.charge("cameras", cameras.size() * sizeof(Camera));
  if (subject.has_mesh()) {
    for (const LightRig& rig : rigs)
      subject.shadows.of_mesh.push_back(std::make_unique<DirectLight>(*subject.rays, rig));
  } else if (!rigs.empty()) {
    budget.charge("shadows", DiscShadows::bytes(lighting.scene(), rigs,
                                                lighting.executor().threads(), request.back_end));
  }
  const bool by_emitters =
      subject.has_mesh() ? subject.rays_at_emitters : lit_by_emitters(lighting.scene());
  lighting.prepare(std::move(budget), lights.sky,
                   {.emitters = !by_emitters, .sampling = request.light_sampling},
                   std::min(request.samples, TileRenderer::kMaxVariants), subject.camera.position,
                   targets.front().path);
  bool sparse = false;
  if (!subject.has_mesh()) {
    if (!rigs.empty()) {
      subject.shadows.of_surfels = std::make_unique<DiscShadows>(
          lighting.scene(), rigs, request.gather.sides, request.back_end, lighting.executor());
    }
    sparse = are_sparse(subject, cameras, request.lift, lighting);
    const Stage stage(report.seconds, progress, "view", subject.all_samples(), "samples");
    see(subject, request, part.tile, view, lighting, progress);
  }
  const auto look = [&](const Camera& camera) {
    Progress silent;
    subject.camera = camera;
    see(subject, request, part.tile, view, lighting, silent);
  };
  const Frame& frame = lighting.scene().header().frame;
  lighting.tune(
      [&] { return pilots_of_frames(subject, cameras, look, frame, lighting.executor()); }, sparse);

  // Render all samples
  {
    const Stage stage(report.seconds, progress, "render", cameras.size() * subject.samples(),
                      "samples");
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      if (i > 0) {
        look(cameras[i]);
        lighting.begin_picture(subject.camera.position);
      }
      TileRenderer({.camera = subject.camera,
                    .side = subject.side,
                    .view = *subject.view,
                    .window = subject.window,
                    .sky = !request.bakes(),
                    .ids = subject.ids ? &*subject.ids : nullptr},
                   subject.shadows, request.light_sampling.sun_rays, lights.sky, lighting)
          .render_all(
              extras_of(request, targets, subject.ids.has_value()),
              [&](const Film& rows, unsigned first) { done(rows, first, subject, i); }, progress);
    }
  }
  lighting.finish();

  // Compare some of the pixels with rays
  const unsigned area_rays = lit_by_emitters(lighting.scene()) ? 1 : 0;
  const LightSampling sampling{.sun_rays = 1, .area_rays = area_rays, .sky_rays = 1};
  lighting.check({.mesh = subject.rays.get(),
                  .light = subject.light.get(),
                  .paths = {.sampling = sampling,
                            .bounces = request.bounces,
                            .emission = !subject.rays_at_emitters}});
  return report;
}

/// Keeps the display that a picture chose for those that follow it.
void keep_display(const std::optional<Display>& chosen, Continuity& kept, LightingReport& report) {
  if (!chosen) return;
  kept.display = chosen;
  report.exposure = std::log2(chosen->gain);
}

/// Renders the light of each group of lights apart, into layers whose sum is the beauty.
LightingReport render_groups(const RenderRequest& request, std::span<const PictureTarget> targets,
                             const std::optional<Moment>& moment, Continuity& kept,
                             Progress& progress) {
  const ContainerReader scene(with_directory_under(request.scene, request.run));
  const LightRig rig = request.lights
                           ? *request.lights
                           : recorded_lights(scene, request.run, targets.front().path, progress);
  check_names(request, targets, rig.sky.map_path);
  Progress silent;
  const bool emits =
      may_emit(scene) ||
      load_meshes(request.meshes, request.mesh.get(), {.moment = moment},
                  mesh_limits(request, rig.sky, targets.front().path), silent, "meshes")
          .mesh.emits();
  const std::vector<std::string> groups = groups_of(request, rig, emits);
  const std::uint64_t sum_bytes =
      Film::pixel_bytes(extras_of(request, targets, has_ids(request, targets))) +
      groups.size() * Film::kGroupBytes;

  // Light the scene for each group
  LightingReport report;
  std::vector<std::unique_ptr<RelitScene>> lit;
  RenderRequest one = request;
  one.run.hold(ContainerReader::kPageBytes * scene.page_count());
  for (const std::string& group : groups) {
    one.lights = only_group(rig, group);
    lit.push_back(std::make_unique<RelitScene>(one, *one.lights, group.empty(),
                                               request.light_sampling, targets.front().path,
                                               report.seconds, silent));
  }

  // Render each picture for each group, and add them up
  one.run = request.run;
  const std::size_t frames = request.sequence ? request.sequence->frames.count() : 1;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    std::vector<PictureTarget> of_frame(targets.begin(), targets.end());
    if (request.sequence) {
      const std::int64_t number = request.sequence->frames[frame];
      of_frame = targets_of_frame(targets, number);
      one.sequence->frames = {number, number};
    }
    std::unique_ptr<Film> sum;
    ImageWindow window;
    ExrText text;
    LightingReport of_picture;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      one.lights = only_group(rig, groups[i]);
      one.bounced.clear();  // of all groups together
      one.scene = lit[i]->path();
      const auto add = [&](const Film& rows, unsigned first, const Subject& subject, std::size_t) {
        if (!sum) {
          window = subject.window;
          if (subject.ids) text = subject.ids->text();
          sum = std::make_unique<Film>(window.width, window.height,
                                       extras_of(one, targets, subject.ids.has_value()));
        }
        sum->add_group(group_channel(groups[i]), rows, first);
      };
      const PicturePart part{
          .emission = groups[i].empty(), .held_bytes = sum_bytes, .moment = moment};
      add_costs(of_picture,
                render_part(one, targets, part, kept, add, frame == 0 ? progress : silent));
    }
    add_run(report, of_picture);
    PictureFiles files(of_frame, window, layer_types(*sum), text, kept.display,
                       roomiest_temp_dir(request.run, targets.front().path));
    files.write(*sum);
    keep_display(files.publish(), kept, report);
  }
  return report;
}

/// Renders the pictures of a container, or bakes one tile of a texture.
LightingReport render_files(const RenderRequest& request, std::span<const PictureTarget> targets,
                            const PicturePart& part, Continuity& kept, Progress& progress) {
  std::vector<PictureTarget> of_frame(targets.begin(), targets.end());
  std::optional<PictureFiles> files;
  LightingReport shown;
  const auto write = [&](const Film& rows, unsigned first, const Subject& subject,
                         std::size_t frame) {
    if (first == 0) {
      if (request.sequence) of_frame = targets_of_frame(targets, request.sequence->frames[frame]);
      files.emplace(of_frame, subject.window, layer_types(rows),
                    subject.ids ? subject.ids->text() : ExrText{}, kept.display,
                    roomiest_temp_dir(request.run, targets.front().path));
    }
    files->write(rows);
    if (first + rows.height() == subject.window.height) keep_display(files->publish(), kept, shown);
  };
  LightingReport report = render_part(request, targets, part, kept, write, progress);
  report.exposure = shown.exposure;
  return report;
}

/// Bakes the vertices of meshes.
LightingReport render_vertices(const RenderRequest& request, std::span<const PictureTarget> targets,
                               Progress& progress) {
  std::optional<VertexFiles> files;
  std::optional<float> exposure;
  const auto write = [&](const Film& rows, unsigned first, const Subject& subject, std::size_t) {
    if (first == 0) {
      files.emplace(targets, subject.mesh, request.exposure,
                    roomiest_temp_dir(request.run, targets.front().path));
    }
    files->write(rows);
    if (first + rows.height() == subject.window.height) exposure = files->publish();
  };
  Continuity kept;
  LightingReport report = render_part(request, targets, {}, kept, write, progress);
  report.exposure = exposure;
  return report;
}

/// Bakes the tiles of a texture of a container.
LightingReport render_tiles(const RenderRequest& request, std::span<const PictureTarget> targets,
                            Progress& progress) {
  Progress silent;
  const std::vector<TextureTile> tiles = texture_tiles(
      load_meshes(request.meshes, request.mesh.get(), {request.backdrop, request.one_sided},
                  mesh_limits(request, {}, targets.front().path), silent, "meshes")
          .mesh);
  return_freed_memory();  // of the meshes, which each tile reads for itself
  return bake_tiles(
      tiles, targets,
      [&](std::span<const PictureTarget> files, const TextureTile& tile) {
        Continuity kept = continuity_of(request);
        return render_files(request, files, {.tile = tile}, kept, progress);
      },
      progress);
}

/// Renders pictures of a container, or bakes its textures or vertices.
/// @param moment  that is seen of a scene that moves
LightingReport render_container(const RenderRequest& request,
                                std::span<const PictureTarget> targets,
                                const std::optional<Moment>& moment, Continuity& kept,
                                Progress& progress) {
  if (request.light_groups) return render_groups(request, targets, moment, kept, progress);
  if (request.texture) return render_tiles(request, targets, progress);
  if (request.vertices) return render_vertices(request, targets, progress);
  return render_files(request, targets, {.moment = moment}, kept, progress);
}

/// Builds a temporary container of clouds and meshes, and renders it. The camera sees meshes as
/// they are, unless there are clouds beside them.
/// @param moment  as for render_container()
/// @param moving  builds the container of a scene that moves; null: the scene stands still
LightingReport render_files_of_scene(const RenderRequest& request,
                                     std::span<const PictureTarget> targets,
                                     const std::optional<Moment>& moment, MovingScene* moving,
                                     Continuity& kept, Progress& progress) {
  const BuiltScene scene(request,
                         {.backdrop = request.backdrop,
                          .one_sided = request.one_sided,
                          .moment = moment,
                          .lights = request.lights,
                          .note_lost_records = false},
                         targets.front().path, progress, moving);
  RenderRequest rendering = request;
  rendering.scene = scene.path();
  rendering.joined.clear();
  const std::vector<std::filesystem::path> files = scene_files(request);
  const std::vector<std::filesystem::path> objects = object_files(files, request.run.memory_bytes);
  if (rendering.meshes.empty() && !rendering.mesh && std::ranges::none_of(objects, holds_points)) {
    rendering.meshes = files;
  } else {
    rendering.camera_files.insert(rendering.camera_files.end(), files.begin(), files.end());
  }
  LightingReport report = render_container(rendering, targets, moment, kept, progress);
  scene.add_stages(report.seconds);
  return report;
}

/// Renders the frames of a scene that moves, each from a container of its own; or the picture of
/// the scene at rest.
LightingReport render_moving(const RenderRequest& request, std::span<const PictureTarget> targets,
                             Continuity& kept, Progress& progress) {
  MovingScene scene(roomiest_temp_dir(request.run, targets.front().path));
  if (!request.sequence) return render_files_of_scene(request, targets, {}, &scene, kept, progress);
  LightingReport report;
  RenderRequest one = request;
  for (std::size_t i = 0; i < request.sequence->frames.count(); ++i) {
    const std::int64_t frame = request.sequence->frames[i];
    one.sequence->frames = {frame, frame};
    add_run(report, render_files_of_scene(one, targets, moment_of(*request.sequence, i), &scene,
                                          kept, progress));
  }
  return report;
}

}  // namespace

LightingReport render_picture(const RenderRequest& request, std::span<const PictureTarget> targets,
                              Progress& progress) {
  check_request(request, targets);
  Continuity kept = continuity_of(request);
  const auto move = [&](const std::vector<std::filesystem::path>& files) {
    return objects_move(files, request.run.memory_bytes);
  };
  if (is_container_alone(request)) {
    if (request.sequence && move(request.meshes)) {
      progress.note(
          "the meshes move, but the container does not: all frames show both as they stand. Name "
          "the meshes in place of the container");
    }
    return render_container(request, targets, {}, kept, progress);
  }
  check_names(request, targets, request.lights ? request.lights->sky.map_path : "");
  std::vector<std::filesystem::path> files = scene_files(request);
  files.insert(files.end(), request.meshes.begin(), request.meshes.end());
  if (move(files)) return render_moving(request, targets, kept, progress);
  return render_files_of_scene(request, targets, {}, nullptr, kept, progress);
}

}  // namespace ptc
