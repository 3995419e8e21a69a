#include "tools/bench/bench_scene.h"

#include <algorithm>
#include <numbers>

#include "engine/io/points.h"
#include "engine/pipeline.h"
#include "engine/primary.h"
#include "engine/scene/city.h"
#include "engine/shade/brute_force.h"
#include "engine/shade/shader.h"
#include "engine/stages.h"

namespace ptc::bench {
namespace {

constexpr std::uint64_t kMostSurfels = 250'000'000;

}  // namespace

SceneChoice parse_scene(const std::string& text) {
  constexpr std::string_view kBackdrop = "+backdrop";
  SceneChoice choice;
  std::string rest = text;
  if (rest.ends_with(kBackdrop)) {
    rest.resize(rest.size() - kBackdrop.size());
    choice.backdrop = true;
  }
  choice.name = rest;
  if (rest == "fractal" || rest == "window" || rest == "city") return choice;
  choice.file = rest;
  const std::string file_name = choice.file.filename().string();
  choice.name = file_name.substr(0, file_name.find('.'));
  return choice;
}

BenchScene::BenchScene(const SceneChoice& choice, const SceneOptions& options, const std::filesystem::path& work,
                       const RunOptions& run, Progress& progress)
    : name_(choice.name), path_(work / (choice.name + ".ptcx")) {
  load(choice, options, run, progress);
  container_ = std::make_unique<ContainerReader>(path_);
  lit_.lights = recorded_lights(*container_);
  surfels_ = load_surfels(*container_, kMostSurfels);
  const Executor executor(run.threads);
  add_camera(options, executor, progress);
  add_points(options);
}

BenchScene::~BenchScene() {
  container_.reset();
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

double BenchScene::spacing() const { return surfel_spacing(*container_); }

void BenchScene::load(const SceneChoice& choice, const SceneOptions& options, const RunOptions& run,
                      Progress& progress) {
  BuildRequest request{.backdrop = choice.backdrop, .run = run};
  request.sampling.count = options.points;
  std::vector<MeshCamera> cameras;
  std::optional<Camera> camera;
  if (choice.name == "city" && choice.file.empty()) {
    request.city_points = options.points;
    lit_.mesh = city_mesh(options.points);
  } else if (choice.file.empty()) {
    lit_ = choice.name == "fractal" ? make_fractal(options.points) : make_window_room();
    request.lights = lit_.lights;
    request.mesh = std::make_shared<const Mesh>(lit_.mesh);
    camera = lit_.camera;
  } else {
    request.inputs.push_back(choice.file);
    lit_.mesh = load_meshes(request.inputs, nullptr, choice.backdrop, &cameras);
  }
  build_container(request, path_, progress);
  if (!camera) {
    const ContainerReader built(path_);
    camera = default_camera(built, cameras, choice.backdrop, std::array{options.width, options.height});
  }
  lit_.camera = *camera;
  lit_.camera.width = options.width;
  lit_.camera.height = options.height;
}

void BenchScene::add_camera(const SceneOptions& options, const Executor& executor, Progress& progress) {
  const Camera& camera = lit_.camera;
  ReceiverSet set{.name = "camera",
                  .window_width = std::min(options.window_width, camera.width),
                  .window_height = std::min(options.window_height, camera.height)};
  std::optional<RayScene> rays;
  std::optional<DirectLight> light;
  std::unique_ptr<PrimaryView> view;
  if (lit_.mesh.triangles.empty()) {
    view = view_surfels(*container_, camera, 1, options.lift, executor, progress);
  } else {
    rays.emplace(lit_.mesh);
    light.emplace(*rays, lit_.lights);
    const auto radius = static_cast<float>(spacing() / std::numbers::sqrt2);
    view = view_mesh(*rays, *light, {.sun_rays = 1, .area_rays = 4, .sky_rays = 0}, camera, 1, options.lift * radius);
  }
  std::vector<std::optional<PrimaryHit>> hits(std::size_t{camera.width} * camera.height);
  executor.for_each(camera.height, [&](std::size_t y, unsigned) {
    for (unsigned x = 0; x < camera.width; ++x) hits[y * camera.width + x] = view->at(x, static_cast<unsigned>(y));
  });
  const unsigned left = (camera.width - set.window_width) / 2, top = (camera.height - set.window_height) / 2;
  for (unsigned y = 0; y < camera.height; ++y) {
    for (unsigned x = 0; x < camera.width; ++x) {
      const auto& hit = hits[std::size_t{y} * camera.width + x];
      const bool inside = x - left < set.window_width && y - top < set.window_height;
      if (inside) set.window.push_back({.receiver = ReceiverSet::kNone});
      if (!hit) continue;
      if (inside) {
        set.window.back() = {.receiver = set.receivers.size(), .albedo = hit->albedo, .direct = hit->direct};
      }
      set.receivers.push_back({hit->position + glm::dvec3(hit->offset_normal * hit->lift), hit->normal});
    }
  }
  sets_.push_back(std::move(set));
}

/// Whole blocks of neighbours, evenly spread: what shading all points meets.
void BenchScene::add_points(const SceneOptions& options) {
  ReceiverSet set{.name = "points"};
  const std::size_t blocks = surfels_.size() / Shader::kBlock;
  const std::size_t wanted = std::max<std::size_t>(1, std::min<std::size_t>(blocks, options.own_points / Shader::kBlock));
  for (std::size_t i = 0; i < wanted; ++i) {
    const std::size_t first = blocks * i / wanted * Shader::kBlock;
    for (std::size_t k = first; k < std::min(first + Shader::kBlock, surfels_.size()); ++k) {
      const Surfel& s = surfels_[k];
      set.receivers.push_back({s.position + glm::dvec3(s.normal * (options.lift * s.radius)), s.normal});
    }
  }
  sets_.push_back(std::move(set));
}

}  // namespace ptc::bench
