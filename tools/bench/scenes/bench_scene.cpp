// From the name of a scene to what is measured:
//
//   name -> build request -> container -> surfels, mesh    what rays are traced against
//                                |   `--> points           every n-th block of neighbouring points
//                                `------> camera           what the pixels of a picture see:
//
//   +---------------------------+
//   | picture                   |   width x height
//   |   +-------------------+   |
//   |   | shaded: receivers |   |   shaded_width x shaded_height
//   |   |   +-----------+   |   |
//   |   |   |  window   |   |   |   window_width x window_height, compared as a picture (FLIP)
//   |   |   +-----------+   |   |
//   +---------------------------+
#include "tools/bench/scenes/bench_scene.h"

#include <algorithm>
#include <numbers>
#include <set>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/cloud/record.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/temporary_container.h"
#include "engine/scene/procedural/city.h"
#include "engine/shade/lift.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/shade/shader.h"
#include "engine/store/container_points.h"
#include "format/text.h"

namespace ptc::bench {
namespace {

constexpr std::uint64_t kMaxSurfels = 250'000'000;

/// The file's name without its ending, in characters that charts, tables and file systems accept.
std::string plain_name(const std::filesystem::path& file) {
  const std::string whole = file.filename().string();
  std::string name = whole.substr(0, whole.find('.', 1));
  const bool utf8 = is_utf8(name);
  for (char& c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f || (byte >= 0x80 && !utf8)) c = '_';
  }
  return name;
}

/// Makes the scene of a word other than city, or of layers.
LitScene procedural_scene(const SceneChoice& choice, std::uint64_t points) {
  if (choice.layers > 0) return make_layers(choice.layers);
  if (choice.name == "fractal") return make_fractal(points);
  if (choice.name == "cornell") return make_cornell(CornellLamp::flat);
  if (choice.name == "box-lamp") return make_cornell(CornellLamp::box);
  if (choice.name == "ajar") return make_ajar_rooms();
  return make_window_room();
}

using Hits = std::vector<std::optional<PrimaryHit>>;

/// A receiver for each pixel that sees something, and the window in the middle of the pixels.
ReceiverSet camera_set(const Hits& hits, unsigned width, unsigned height,
                       const SceneOptions& options) {
  ReceiverSet set{.name = "camera",
                  .window_width = std::min(options.window_width, width),
                  .window_height = std::min(options.window_height, height)};
  const unsigned left = (width - set.window_width) / 2, top = (height - set.window_height) / 2;
  for (unsigned y = 0; y < height; ++y) {
    for (unsigned x = 0; x < width; ++x) {
      // `left` and `top` are unsigned: in front of the window the differences wrap to large
      // numbers.
      const auto& hit = hits[std::size_t{y} * width + x];
      const bool inside = x - left < set.window_width && y - top < set.window_height;
      if (inside) set.window.push_back({.receiver = ReceiverSet::kNone});
      if (!hit) continue;
      if (inside) {
        set.window.back() = {
            .receiver = set.receivers.size(), .albedo = hit->albedo, .direct = hit->direct};
      }
      set.receivers.push_back(
          {hit->position + glm::dvec3(hit->offset_normal * hit->lift), hit->normal});
    }
  }
  return set;
}

}  // namespace

SceneChoice parse_scene(const std::string& text) {
  constexpr std::string_view kBackdrop = "+backdrop";
  SceneChoice choice;
  std::string rest = text;
  if (rest.ends_with(kBackdrop)) {
    rest.resize(rest.size() - kBackdrop.size());
    choice.backdrop = true;
  }
  if (rest.empty())
    throw RequestError("scenes",
                       "'" + text + "': names no scene. Give fractal, window, city or a file");
  choice.name = rest;
  if (std::ranges::find(kSceneWords, rest) != kSceneWords.end()) {
    if (choice.backdrop)
      throw RequestError("scenes", text + ": only the file of a mesh can stand before a backdrop");
    return choice;
  }
  choice.file = rest;
  choice.name = plain_name(choice.file);
  return choice;
}

std::vector<SceneChoice> parse_scenes(const std::vector<std::string>& texts) {
  std::vector<SceneChoice> choices;
  std::set<std::string> taken;
  for (const std::string& text : texts) {
    SceneChoice choice = parse_scene(text);
    const std::string name = choice.name;
    for (int number = 2; !taken.insert(choice.name).second; ++number) {
      choice.name = name + "-" + std::to_string(number);
    }
    choices.push_back(std::move(choice));
  }
  return choices;
}

SceneRequest request_scene(const SceneChoice& choice, const SceneOptions& options,
                           const RunOptions& run) {
  SceneRequest scene{.build = {.backdrop = choice.backdrop, .profile = options.profile, .run = run},
                     .lit = {}};
  scene.build.sampling.count = options.points;
  scene.build.tree.levels_per_stream = options.levels_per_stream;
  scene.build.page_shift = options.page_shift;
  if (!choice.file.empty()) {
    scene.build.inputs.push_back(choice.file);
    scene.build.inputs.insert(scene.build.inputs.end(), choice.more.begin(), choice.more.end());
  } else if (choice.name == "city") {
    scene.build.city_points = options.points;
  } else {
    scene.lit = procedural_scene(choice, options.points);
    scene.build.lights = scene.lit.lights;
    scene.build.mesh = std::make_shared<const Mesh>(scene.lit.mesh);
  }
  return scene;
}

LitScene build_scene(const SceneChoice& choice, const SceneOptions& options,
                     const std::filesystem::path& target, const RunOptions& run,
                     Progress& progress) {
  // Read or make the mesh
  auto [request, lit] = request_scene(choice, options, run);
  std::vector<MeshCamera> cameras;
  const bool procedural = request.mesh != nullptr;
  if (!choice.file.empty()) {
    Progress silent;  // the build reads the file again and reports what it leaves out
    lit.mesh = load_meshes(request.inputs, nullptr, {.backdrop = choice.backdrop}, {}, silent).mesh;
    cameras = file_cameras(request.inputs);
  } else if (!procedural && options.rays) {
    lit.mesh = city_mesh(options.points);
  }
  // Build the container, and take light and camera from it
  build_container(request, target, progress);
  const ContainerReader container(target);
  lit.lights = recorded_lights(container, run, target, progress);
  if (!procedural) {
    std::optional<Bounds> subject;
    if (choice.backdrop) subject = bounds_before_backdrop(lit.mesh);
    lit.camera =
        default_camera(container, cameras, subject, std::array{options.width, options.height});
  }
  lit.camera.width = options.width;
  lit.camera.height = options.height;
  return std::move(lit);
}

BenchScene::BenchScene(const SceneChoice& choice, const SceneOptions& options,
                       const std::filesystem::path& work, const RunOptions& run, Progress& progress)
    : name_(choice.name) {
  container_ = make_temporary_container(work, [&](const std::filesystem::path& path) {
    lit_ = build_scene(choice, options, path, run, progress);
  });
  if (options.rays) surfels_ = load_surfels(*container_, kMaxSurfels);
  const ThreadPool executor(run.threads);
  if (options.shaded_width > 0) add_camera(options, executor, progress);
  add_points(options);
}

double BenchScene::spacing() const {
  return surfel_spacing(*container_);
}

void BenchScene::add_camera(const SceneOptions& options, const Executor& executor,
                            Progress& progress) {
  // Prepare the view: triangles where there is a mesh, else surfels
  const Camera& camera = lit_.camera;
  std::optional<RayScene> rays;
  std::optional<DirectLight> light;
  std::unique_ptr<PrimaryView> view;
  if (lit_.mesh.triangles.empty()) {
    view = view_surfels(*container_, camera, {.lift = options.lift}, executor, progress);
  } else {
    rays.emplace(lit_.mesh);
    light.emplace(*rays, lit_.lights);
    const float radius = surfel_radius(*container_);
    view = view_mesh(*rays, *light, {.sun_rays = 1, .area_rays = 4, .sky_rays = 0}, camera, 1,
                     options.lift * radius);
  }
  // Trace the pixels in the picture's middle
  const unsigned width = std::min(options.shaded_width, camera.width);
  const unsigned height = std::min(options.shaded_height, camera.height);
  const unsigned left = (camera.width - width) / 2, top = (camera.height - height) / 2;
  Hits hits(std::size_t{width} * height);
  executor.for_each(height, [&](std::size_t y, unsigned) {
    for (unsigned x = 0; x < width; ++x)
      hits[y * width + x] = view->at(left + x, top + static_cast<unsigned>(y));
  });
  sets_.push_back(camera_set(hits, width, height, options));
}

/// Adds whole blocks of neighbouring points, evenly spread over the scene, whose locality is that
/// of shading all points; and single points, as evenly spread, which share nothing.
void BenchScene::add_points(const SceneOptions& options) {
  ReceiverSet set{.name = "points"}, sparse{.name = "sparse"};
  const std::uint64_t points = container_->superblock().points;
  const std::uint64_t spread = std::min(points, options.sparse_points);
  const std::size_t blocks = points / Shader::kBlock;
  const std::size_t wanted =
      std::max<std::size_t>(1, std::min<std::size_t>(blocks, options.own_points / Shader::kBlock));
  ContainerPoints all(*container_);
  std::vector<PointRecord> block(Shader::kBlock);
  const auto receiver = [&](const PointRecord& point) {
    return lifted(to_surfel(point, container_->header().frame), options.lift,
                  container_->header().frame);
  };
  std::size_t taken = 0;
  std::uint64_t first = 0;
  for (std::size_t at = 0; const std::size_t count = all.next(block); ++at, first += count) {
    // Take the next of the points that lie far apart, as many as the block has
    while (sparse.receivers.size() < spread) {
      const std::uint64_t next = (2 * sparse.receivers.size() + 1) * points / (2 * spread);
      if (next >= first + count) break;
      sparse.receivers.push_back(receiver(block[next - first]));
    }
    // Take the block if it is the next of those that are evenly spread
    if (taken == wanted || (blocks > 0 && at != blocks * taken / wanted)) continue;
    ++taken;
    for (std::size_t i = 0; i < count; ++i) set.receivers.push_back(receiver(block[i]));
  }
  sets_.push_back(std::move(set));
  sets_.push_back(std::move(sparse));
}

}  // namespace ptc::bench
