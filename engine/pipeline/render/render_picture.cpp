#include "engine/pipeline/render/render_picture.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/io/image/image.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/light/built_scene.h"
#include "engine/pipeline/light/group_scenes.h"
#include "engine/pipeline/light/group_shadows.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/tile_renderer.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/shading_channels.h"
#include "engine/shade/lift.h"

namespace ptc {
namespace {

// Bytes of a pixel of a tile (hit, receiver, result, order), and of what estimates add to it
constexpr std::uint64_t kReceiverBytes = 336;
constexpr std::uint64_t kEstimateBytes = sizeof(Shading) + sizeof(ErrorEstimate);

/// The subject of a picture: the camera, what it sees and what lights it. The view refers to the
/// other members.
struct Subject {
  Camera camera;
  unsigned side = 1;  ///< samples of a pixel lie on a grid of side x side
  Mesh mesh;          ///< empty: the camera sees the surfels
  std::unique_ptr<RayScene> rays;
  std::unique_ptr<DirectLight> light;
  PictureShadows shadows;
  bool rays_at_emitters = false;  ///< those of the mesh light it by rays, and not by the gather
  std::unique_ptr<PrimaryView> view;
  std::uint64_t texture_bytes = 0;  ///< of the view of a texture

  [[nodiscard]] std::uint64_t pixels() const { return std::uint64_t{camera.width} * camera.height; }
  [[nodiscard]] std::uint64_t samples() const { return pixels() * side * side; }
};

/// Returns the side of the grid on which the samples of a pixel lie.
/// @throws RequestError when `samples` is no square number
unsigned side_of(unsigned samples) {
  const auto side = static_cast<unsigned>(std::lround(std::sqrt(samples)));
  if (side == 0 || side * side != samples) {
    throw RequestError("samples", fmt::format("`samples` is {}: it must be a square number, such "
                                              "as 1, 4, 9 or 16",
                                              samples));
  }
  return side;
}

/// @throws RequestError when a picture of this camera has no pixels or too many
void check_size(const Camera& camera) {
  if (is_image_size(camera.width, camera.height)) return;
  throw RequestError("size",
                     fmt::format("`size` is {} x {}: a picture has 1 to {} pixels along each "
                                 "side, and at most {} in all",
                                 camera.width, camera.height, kMaxImageSide, kMaxImagePixels));
}

/// Says whether a box and the bounds of a scene's points have a place in common.
bool overlap(const Bounds& box, const Superblock& scene) {
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    if (box.high[k] < scene.bounds_low[axis] || box.low[k] > scene.bounds_high[axis]) return false;
  }
  return true;
}

/// What a run renders when light is kept apart.
struct Part {
  bool emission = true;          ///< whether the meshes emit
  std::uint64_t held_bytes = 0;  ///< for each pixel, of the pictures of other parts
  TextureTile tile;              ///< that is baked, if it is a texture
};

/// Returns the memory for meshes. While they are read, only the sky takes any beside them.
/// @param target  as for roomiest_temp_dir()
MeshLimits mesh_limits(const RenderRequest& request, const Sky& sky,
                       const std::filesystem::path& target) {
  constexpr std::uint64_t kOthers = std::uint64_t{96} << 20;  // a tile, rows, a gather, its pages
  constexpr std::uint64_t kLeast = std::uint64_t{26} << 20;   // refused rather than not seen
  MemoryBudget budget = budget_of(request.run.memory_bytes, "this picture");
  charge_sky(budget, sky);
  const std::uint64_t left = budget.left();
  return {.reading = left,
          .kept = std::max(left / 4, kLeast),
          .traced = std::max(left > kOthers ? left - kOthers : 0, kLeast),
          .textures = texture_cap(request.run),
          .temp_directory = roomiest_temp_dir(request.run, target)};
}

/// Loads the meshes and finds the camera.
/// @param target  as for roomiest_temp_dir()
void load_subject(Subject& subject, const RenderRequest& request, const Part& part,
                  const ContainerReader& scene, const Sky& sky, const std::filesystem::path& target,
                  Progress& progress) {
  std::vector<MeshCamera> cameras;
  LoadedMeshes meshes =
      load_meshes(request.meshes, request.mesh.get(), {request.backdrop, request.one_sided},
                  mesh_limits(request, sky, target), progress, &cameras, "meshes");
  if (meshes.parts) {
    progress.note("the meshes do not fit in memory: the camera sees the surfels");
  }
  subject.mesh = std::move(meshes.mesh);
  if (!part.emission) {
    for (Material& material : subject.mesh.materials) material.emission = glm::vec3(0);
  }
  if (!subject.mesh.triangles.empty() && !overlap(subject.mesh.bounds(), scene.superblock())) {
    progress.note(
        "the meshes lie outside of the scene: is this the container that was built from them?");
  }
  if (request.texture) {
    constexpr unsigned kSide = 1024;
    require_request(!subject.mesh.triangles.empty(), "meshes",
                    meshes.parts ? "the meshes do not fit in memory, as baking a texture asks for"
                                 : "there is no mesh whose texture is to be baked");
    const Bounds box = subject.mesh.bounds();
    subject.camera = {.position = 0.5 * (box.low + box.high), .width = kSide, .height = kSide};
  } else if (request.camera) {
    subject.camera = *request.camera;
  } else {
    std::optional<Bounds> box;
    if (request.backdrop && !subject.mesh.triangles.empty())
      box = bounds_before_backdrop(subject.mesh);
    subject.camera = default_camera(scene, cameras, box, request.size);
  }
  if (request.size) {
    subject.camera.width = (*request.size)[0];
    subject.camera.height = (*request.size)[1];
  }
  check_size(subject.camera);
}

/// Makes a view of the texture of the subject's mesh, and notes what of it is not as one expects.
void make_texture_view(Subject& subject, const RenderRequest& request,
                       const LightSampling& sampling, float radius, float lift, const Part& part,
                       const Executor& executor, Progress& progress) {
  const glm::uvec2 size(subject.camera.width, subject.camera.height);
  MemoryBudget budget = budget_of(request.run.memory_bytes, "this texture");
  charge_mesh(budget, subject.mesh, subject.rays.get());
  budget.charge("the mesh in its texture", TextureView::bytes_for(*subject.rays, size));
  budget.require();
  auto view = std::make_unique<TextureView>(*subject.rays, *subject.light, sampling,
                                            glm::uvec2(subject.camera.width, subject.camera.height),
                                            subject.side, radius, lift, *request.texture, part.tile,
                                            executor);
  subject.texture_bytes = view->bytes();
  if (view->covered() == 0) {
    progress.note(
        "no middle of a texel lies on a surface: the texture coordinates are outside of the "
        "texture, or cover too little of it");
  }
  constexpr double kMuch = 1.05;  // a texel at the edge of an island counts as a whole
  if (const double overlap = view->overlap(); overlap > kMuch) {
    progress.note(fmt::format(
        "parts of the meshes share texels, {:.2g} to one in the mean: each shows one of them",
        overlap));
  }
  subject.view = std::move(view);
}

/// Makes a view of the subject's mesh by rays.
void make_mesh_view(Subject& subject, const RenderRequest& request, const Part& part,
                    const Lighting& lighting, const LightRig& lights, Progress& progress) {
  const ContainerReader& scene = lighting.scene();
  const double surfel_radius = surfel_spacing(scene) / std::numbers::sqrt2;
  subject.rays = std::make_unique<RayScene>(subject.mesh);
  subject.light = std::make_unique<DirectLight>(*subject.rays, lights);
  return_freed_memory();  // that reading the files and building the ray scene took
  // The light that emitters gave to surfaces is in their radiance already, or else is gathered
  LightSampling sampling = request.light_sampling;
  subject.rays_at_emitters =
      lit_by_emitters(scene) && subject.mesh.emits() && sampling.area_rays > 0;
  if (!subject.rays_at_emitters) sampling.area_rays = 0;
  const float lift =
      lift_height(static_cast<float>(surfel_radius), request.lift, scene.header().frame);
  if (request.texture) {
    make_texture_view(subject, request, sampling, static_cast<float>(surfel_radius), lift, part,
                      lighting.executor(), progress);
  } else {
    subject.view =
        view_mesh(*subject.rays, *subject.light, sampling, subject.camera, subject.side, lift);
  }
}

/// The memory of a view of surfels.
struct SurfelViewBytes {
  std::uint64_t depth = 0;  ///< of its depth buffer
  /// Memory of the pages that a view of parts keeps; 0 for a view of the whole picture, which is
  /// made with the pages of the gather, before that begins.
  std::uint64_t pages = 0;
};

/// Returns the memory of the view of a subject: a quarter of the cap may be a depth buffer of the
/// whole picture, or an eighth one of a part.
SurfelViewBytes surfel_view_bytes(const Subject& subject, const Lighting& lighting,
                                  std::uint64_t cap) {
  const std::uint64_t all = subject.samples() * kSplatBytes;
  if (all <= cap / 4) return {all, 0};
  const Tile tile = TileRenderer::tile_of(subject.camera.width, subject.side);
  const std::uint64_t least =
      depth_bytes_for(tile.width * subject.side, tile.height * subject.side);
  return {std::max(cap / 8, least),
          view_bytes(lighting.scene(), lighting.executor().threads(), lighting.back_end())};
}

/// Makes a view of the scene's surfels.
/// @param sparse  becomes whether its samples lie far apart (spec/shading.md#sparse-pictures)
void make_surfel_view(Subject& subject, float lift, const SurfelViewBytes& bytes,
                      const Lighting& lighting, LightingReport& report, bool& sparse,
                      Progress& progress) {
  const ContainerReader& scene = lighting.scene();
  const Stage stage(report.seconds, progress, "view", subject.samples(), "samples");
  SurfelViewOptions options{.side = subject.side,
                            .lift = lift,
                            .lost = lighting.lost(),
                            .memory_bytes = lighting.cache_bytes(),
                            .depth_bytes = bytes.depth,
                            .back_end = lighting.back_end()};
  sparse = sparse_share(scene, subject.camera, options, lighting.executor()) > 0.5;
  if (bytes.pages > 0) options.memory_bytes = bytes.pages;
  subject.view = view_surfels(scene, subject.camera, options, lighting.executor(), progress);
  return_freed_memory();
}

FilmExtras extras_of(const RenderRequest& request) {
  FilmExtras extras{.estimates = request.estimate,
                    .glossy = request.glossy.roughness.has_value(),
                    .irradiance = request.texture.has_value()};
  for (const std::string& group : request.shadows) extras.shadows.push_back(shadow_channel(group));
  return extras;
}

/// Returns what an .exr says of the layers of films.
std::vector<ExrLayerType> layer_types(const Film& film) {
  std::vector<ExrLayerType> types;
  for (const Film::Layer& layer : film.layers()) types.push_back(layer.type);
  return types;
}

/// Returns a budget that is charged with everything that rendering takes besides the gather.
/// @param view  of the surfels, if the subject has no mesh
MemoryBudget picture_budget(const RenderRequest& request, std::span<const PictureTarget> targets,
                            const Part& part, const Subject& subject, const SurfelViewBytes& view) {
  MemoryBudget budget = budget_of(request.run.memory_bytes, "this picture");
  const bool glossy = request.glossy.roughness.has_value();
  const std::uint64_t receiver =
      kReceiverBytes + (request.estimate ? kEstimateBytes : 0) + (glossy ? sizeof(Reflection) : 0);
  budget.charge("a tile", TileRenderer::kSamplesAtOnce * receiver);
  const FilmExtras extras = extras_of(request);
  const Camera& camera = subject.camera;
  const unsigned rows =
      std::min(camera.height, TileRenderer::tile_of(camera.width, subject.side).height);
  budget.charge("rows of the picture", Film::pixel_bytes(extras) * camera.width * rows);
  if (part.held_bytes > 0) {
    budget.charge("the picture of all groups", subject.pixels() * part.held_bytes);
  } else {
    budget.charge("the files of the picture",
                  PictureFiles::bytes(targets, camera.width, layer_types(Film(1, 1, extras))));
  }
  if (subject.rays) {
    charge_mesh(budget, subject.mesh, subject.rays.get());
    if (request.texture) budget.charge("the mesh in its texture", subject.texture_bytes);
  } else {
    budget.charge("the depth buffer", view.depth);
    if (view.pages > 0) budget.charge("pages that the camera sees", view.pages);
  }
  return budget;
}

/// Returns windows of receivers that stand for all receivers of a picture. Windows in which the
/// camera meets nothing are left out.
std::vector<Pilot> pilots_of(const Subject& subject, const Executor& executor) {
  // Choose the size of a window; multiples of the shares kGolden cover the plane evenly (Roberts
  // 2018)
  constexpr double kGolden[2] = {0.7548776662466927, 0.5698402909980532};
  constexpr unsigned kMaxSide = 32;
  const Camera& camera = subject.camera;
  const unsigned side = subject.side;
  const PilotPlan plan = plan_pilots(subject.samples());
  const unsigned width = std::min(kMaxSide, camera.width),
                 height = std::min(kMaxSide, camera.height);

  // Find what the windows see, in twice as many as are wanted: some may see nothing
  std::vector<Pilot> pilots(2 * plan.count);
  for (std::size_t i = 0; i < pilots.size(); ++i) {
    const auto place = [&](int axis, unsigned room) {
      const double turn = kGolden[axis] * static_cast<double>(i + 1);
      return static_cast<unsigned>((turn - std::floor(turn)) * (room + 1.0));
    };
    const unsigned x0 = place(0, camera.width - width), y0 = place(1, camera.height - height);
    pilots[i].variant = static_cast<unsigned>(i / 2) % (side * side);
    subject.view->look_at(samples_of({x0, y0, width, height}, side), false);
    std::vector<std::optional<PrimaryHit>> hits(std::size_t{width} * height);
    executor.for_each(height, [&](std::size_t row, unsigned) {
      for (unsigned column = 0; column < width; ++column) {
        // Begin each row elsewhere, so that those that are compared lie all over the window
        const auto y = y0 + static_cast<unsigned>(row);
        const unsigned x = x0 + (column + width / 2 + 5 * (y - y0)) % width;
        const auto [sx, sy] = sample_at(x, y, pilots[i].variant, side);
        hits[row * width + column] = subject.view->at(sx, sy);
      }
    });
    for (const auto& hit : hits) {
      if (hit) pilots[i].receivers.push_back(receiver_at(*hit));
    }
  }

  // Keep the first ones that see something
  std::erase_if(pilots, [](const Pilot& pilot) { return pilot.receivers.empty(); });
  pilots.resize(std::min(pilots.size(), plan.count));
  return pilots;
}

/// Checks that every picture has a file of its own, which is none that the run reads.
/// @throws RequestError
void check_names(const RenderRequest& request, std::span<const PictureTarget> targets,
                 const std::string& sky_picture) {
  std::vector<std::filesystem::path> taken = scene_files(request);
  taken.insert(taken.end(), request.meshes.begin(), request.meshes.end());
  if (!sky_picture.empty()) taken.emplace_back(sky_picture);
  const std::size_t read = taken.size();
  for (const PictureTarget& target : targets) {
    for (std::size_t i = 0; i < taken.size(); ++i) {
      if (!same_name(target.path, taken[i])) continue;
      throw RequestError(
          "targets", target.path.string() + (i < read ? " is read by this run: choose another name"
                                                      : " is the name of two pictures"));
    }
    taken.push_back(target.path);
  }
}

/// @throws RequestError when there is no target, when the ending of one is neither .exr nor .png,
///         when a layer is unknown or not asked for, or when estimates, shadows or groups have no
///         .exr to go to
void check_targets(const RenderRequest& request, std::span<const PictureTarget> targets) {
  if (targets.empty()) throw RequestError("targets", "no picture to write is named");
  bool exr = false;
  for (const PictureTarget& target : targets) {
    const std::string ending = lower_extension(target.path);
    if (ending != ".exr" && ending != ".png") {
      throw RequestError("targets", "the name of a picture must end in .exr or .png, but is " +
                                        target.path.string());
    }
    if (std::ranges::find(kPictureLayers, target.layer) == kPictureLayers.end()) {
      throw RequestError("targets", "a picture has no layer '" + target.layer + "' for a .png");
    }
    if (target.layer == "reflection" && ending == ".png" && !request.glossy.roughness) {
      throw RequestError(
          "targets",
          "the layer 'reflection' needs a roughness: ask for `glossy.roughness` as well");
    }
    if (target.layer == "irradiance" && !request.texture) {
      throw RequestError("targets", "a picture has no layer 'irradiance': only a texture has it");
    }
    exr |= ending == ".exr";
  }
  if (!request.shadows.empty() && !exr) {
    throw RequestError("shadows",
                       "`shadows` adds layers, which only an .exr has: name an .exr as output");
  }
  if (request.light_groups && !exr) {
    throw RequestError("light_groups",
                       "`light_groups` adds layers, which only an .exr has: name "
                       "an .exr as output");
  }
  if (request.estimate && !exr) {
    throw RequestError("estimate",
                       "`estimate` adds layers, which only an .exr has: name an .exr as output");
  }
}

/// Checks what can be checked before any file is read.
/// @throws RequestError
void check_request(const RenderRequest& request, std::span<const PictureTarget> targets) {
  check_targets(request, targets);
  if (request.lights) check_lights(*request.lights);
  if (request.camera) check_camera(*request.camera, "camera");
  require_request(!request.texture || !request.light_groups, "light_groups",
                  "`light_groups` is for pictures: a texture has no layers for them");
  static_cast<void>(side_of(request.samples));
}

/// Gets complete rows of the picture that a camera sees, from the top down.
using RowsSeen = std::function<void(const Film& rows, unsigned first, const Camera& camera)>;

/// Renders a container.
LightingReport render_part(const RenderRequest& request, std::span<const PictureTarget> targets,
                           const Part& part, const RowsSeen& done, Progress& progress) {
  // Open the scene and load what the camera sees
  LightingReport report;
  Subject subject{.side = side_of(request.samples)};
  Lighting lighting(request, report, progress);
  const LightRig lights = request.lights ? *request.lights
                                         : recorded_lights(lighting.scene(), request.run,
                                                           targets.front().path, progress);
  check_names(request, targets, lights.sky.map_path);
  load_subject(subject, request, part, lighting.scene(), lights.sky, targets.front().path,
               progress);
  const bool sees_mesh = !subject.mesh.triangles.empty();
  if (sees_mesh) make_mesh_view(subject, request, part, lighting, lights, progress);
  const std::vector<LightRig> rigs = rigs_of_groups(lights, request.shadows);

  // Divide the memory, shade earlier bounces, choose the settings
  const SurfelViewBytes view = surfel_view_bytes(subject, lighting, request.run.memory_bytes);
  MemoryBudget budget = picture_budget(request, targets, part, subject, view);
  if (sees_mesh) {
    for (const LightRig& rig : rigs)
      subject.shadows.of_mesh.push_back(std::make_unique<DirectLight>(*subject.rays, rig));
  } else if (!rigs.empty()) {
    budget.charge("shadows", DiscShadows::bytes(lighting.scene(), rigs,
                                                lighting.executor().threads(), request.back_end));
  }
  const bool by_emitters = sees_mesh ? subject.rays_at_emitters : lit_by_emitters(lighting.scene());
  lighting.prepare(std::move(budget), lights.sky, !by_emitters,
                   std::min(request.samples, TileRenderer::kMaxVariants), subject.camera.position,
                   targets.front().path);
  if (!sees_mesh && !rigs.empty()) {
    subject.shadows.of_surfels = std::make_unique<DiscShadows>(
        lighting.scene(), rigs, request.gather.sides, request.back_end, lighting.executor());
  }
  bool sparse = false;
  if (!sees_mesh) {
    make_surfel_view(subject, request.lift, view, lighting, report, sparse, progress);
  }
  lighting.tune([&] { return pilots_of(subject, lighting.executor()); }, sparse);

  // Render all samples
  {
    const Stage stage(report.seconds, progress, "render", subject.samples(), "samples");
    TileRenderer({.camera = subject.camera,
                  .side = subject.side,
                  .view = *subject.view,
                  .sky = !request.texture},
                 subject.shadows, request.light_sampling.sun_rays, lights.sky, lighting)
        .render_all(
            extras_of(request),
            [&](const Film& rows, unsigned first) { done(rows, first, subject.camera); }, progress);
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

/// Renders the light of each group of lights apart, into layers whose sum is the beauty.
LightingReport render_groups(const RenderRequest& request, std::span<const PictureTarget> targets,
                             Progress& progress) {
  const ContainerReader scene(with_directory_under(request.scene, request.run));
  const LightRig rig = request.lights
                           ? *request.lights
                           : recorded_lights(scene, request.run, targets.front().path, progress);
  check_names(request, targets, rig.sky.map_path);
  Progress silent;
  const bool emits =
      may_emit(scene) ||
      load_meshes(request.meshes, request.mesh.get(), {},
                  mesh_limits(request, rig.sky, targets.front().path), silent, nullptr, "meshes")
          .mesh.emits();
  const std::vector<std::string> groups = groups_of(request, rig, emits);
  const std::uint64_t sum_bytes = Film::pixel_bytes({}) + groups.size() * Film::kGroupBytes;
  LightingReport report;
  std::unique_ptr<Film> sum;
  std::uint64_t held = ContainerReader::kPageBytes * scene.page_count();
  for (const std::string& group : groups) {
    // Light the scene with what the sum leaves of the memory
    const bool rest = group.empty();
    RenderRequest one = request;
    one.lights = only_group(rig, group);
    one.run.hold(held);
    const RelitScene lit(one, *one.lights, rest, request.light_sampling, targets.front().path,
                         report.seconds, silent);
    // Render it, and add the picture to the sum
    one.run = request.run;
    one.scene = lit.path();
    const auto add = [&](const Film& rows, unsigned first, const Camera& camera) {
      if (!sum) {
        sum = std::make_unique<Film>(camera.width, camera.height, FilmExtras{});
        held += sum_bytes * camera.width * camera.height;
      }
      sum->add_group(group_channel(group), rows, first);
    };
    const Part part{.emission = rest, .held_bytes = sum_bytes};
    add_costs(report, render_part(one, targets, part, add, progress));
  }
  PictureFiles files(targets, sum->width(), sum->height(), layer_types(*sum), request.exposure,
                     roomiest_temp_dir(request.run, targets.front().path));
  files.write(*sum);
  report.exposure = files.publish();
  return report;
}

/// Renders a picture of a container, or bakes one tile of a texture.
LightingReport render_files(const RenderRequest& request, std::span<const PictureTarget> targets,
                            const Part& part, Progress& progress) {
  std::optional<PictureFiles> files;
  std::optional<float> exposure;
  const auto write = [&](const Film& rows, unsigned first, const Camera& camera) {
    if (!files) {
      files.emplace(targets, camera.width, camera.height, layer_types(rows), request.exposure,
                    roomiest_temp_dir(request.run, targets.front().path));
    }
    files->write(rows);
    if (first + rows.height() == camera.height) exposure = files->publish();
  };
  LightingReport report = render_part(request, targets, part, write, progress);
  report.exposure = exposure;
  return report;
}

/// Bakes the tiles of a texture of a container.
LightingReport render_tiles(const RenderRequest& request, std::span<const PictureTarget> targets,
                            Progress& progress) {
  Progress silent;
  const std::vector<TextureTile> tiles = texture_tiles(
      load_meshes(request.meshes, request.mesh.get(), {request.backdrop, request.one_sided},
                  mesh_limits(request, {}, targets.front().path), silent, nullptr, "meshes")
          .mesh);
  return_freed_memory();  // of the meshes, which each tile reads for itself
  return bake_tiles(
      tiles, targets,
      [&](std::span<const PictureTarget> files, const TextureTile& tile) {
        return render_files(request, files, {.tile = tile}, progress);
      },
      progress);
}

/// Renders a picture of a container, or bakes its textures.
LightingReport render_container(const RenderRequest& request,
                                std::span<const PictureTarget> targets, Progress& progress) {
  if (request.light_groups) return render_groups(request, targets, progress);
  if (request.texture) return render_tiles(request, targets, progress);
  return render_files(request, targets, {}, progress);
}

}  // namespace

LightingReport render_picture(const RenderRequest& request, std::span<const PictureTarget> targets,
                              Progress& progress) {
  check_request(request, targets);
  if (is_container_alone(request)) return render_container(request, targets, progress);
  // Build a temporary container of clouds and meshes. The camera sees meshes as they are, unless
  // there are clouds beside them.
  check_names(request, targets, request.lights ? request.lights->sky.map_path : "");
  const std::vector<std::filesystem::path> files = scene_files(request);
  const BuiltScene scene(request,
                         {.backdrop = request.backdrop,
                          .one_sided = request.one_sided,
                          .lights = request.lights,
                          .note_lost_records = false},
                         targets.front().path, progress);
  RenderRequest rendering = request;
  rendering.scene = scene.path();
  rendering.joined.clear();
  const SceneObjects objects = read_scene_objects(files, nullptr, request.run.memory_bytes);
  const bool has_points = std::ranges::any_of(
      objects.objects, [](const SceneObject& object) { return holds_points(object.file); });
  if (rendering.meshes.empty() && !rendering.mesh && !has_points) rendering.meshes = files;
  if (rendering.meshes.empty() && !rendering.camera && !objects.cameras.empty())
    rendering.camera = camera_of(objects.cameras.front(), request.size);
  LightingReport report = render_container(rendering, targets, progress);
  scene.add_stages(report.seconds);
  return report;
}

}  // namespace ptc
