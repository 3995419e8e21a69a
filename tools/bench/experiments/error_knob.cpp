#include "tools/bench/experiments/error_knob.h"

#include <utility>

#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/scene_record.h"
#include "engine/shade/lift.h"
#include "engine/shade/reference/brute_force.h"
#include "format/point_page.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

/// Wall seconds of the stage that shades.
double shading_seconds(const LightingReport& report) {
  double sum = 0;
  for (const auto& [stage, seconds] : report.seconds) {
    if (stage == "shade" || stage == "render") sum += seconds;
  }
  return sum;
}

ErrorRow row_of(const std::string& scene, const std::string& set, const LightingReport& report) {
  const double pilots = report.tuning->ray_cpu_seconds + report.tuning->shade_cpu_seconds;
  const auto receivers = static_cast<double>(std::max<std::uint64_t>(1, report.receivers));
  return {.scene = scene,
          .set = set,
          .asked = report.tuning->asked,
          .tuning = *report.tuning,
          .check = *report.check,
          .receivers = report.receivers,
          .us_per_receiver = report.shade_cpu_seconds * 1e6 / receivers,
          .wall_us_per_receiver = shading_seconds(report) * 1e6 / receivers,
          .pilot_share = pilots / std::max(1e-9, pilots + report.shade_cpu_seconds)};
}

/// Whole blocks of the scene's points, evenly spread, so that locality is that of shading all
/// points.
std::vector<Pilot> blocks_of(const ContainerReader& container, unsigned wanted, float lift) {
  const PageNumbers::Range pages = container.point_pages();
  const std::size_t per_page = points_per_page(container.header());
  const std::size_t pages_of_block = (Shader::kBlock + per_page - 1) / per_page;
  const std::size_t count =
      std::min<std::size_t>(wanted, std::max<std::size_t>(1, pages.size() / pages_of_block));
  std::vector<Pilot> blocks;
  for (std::size_t i = 0; i < (pages.empty() ? 0 : count); ++i) {
    const std::size_t first = (pages.size() - std::min(pages.size(), pages_of_block)) * i /
                              std::max<std::size_t>(1, count - 1);
    std::vector<Surfel> surfels;
    append_surfels(container, pages.subrange(first, std::min(pages_of_block, pages.size() - first)),
                   surfels);
    surfels.resize(std::min(surfels.size(), Shader::kBlock));
    std::vector<Receiver> block;
    for (const Surfel& s : surfels) block.push_back(lifted(s, lift, container.header().frame));
    add_pilots(blocks, std::move(block), 0, 1, 1);
  }
  return blocks;
}

}  // namespace

double SceneErrors::slope() const {
  std::vector<std::pair<double, double>> measured;
  for (const RungError& rung : rungs) {
    if (rung.error.relative() > 0 && rung.us_per_receiver > 0)
      measured.emplace_back(rung.us_per_receiver, rung.error.relative());
  }
  return fit_power_law(measured).exponent;
}

SceneErrors measure_errors(const SceneChoice& choice, const ErrorOptions& options,
                           const std::filesystem::path& work, const RunOptions& run,
                           Progress& progress) {
  // Build the scene and prepare the requests
  const WorkFile scene(work, ".ptcx"), points(work, ".ply"), picture(work, ".exr");
  const LitScene lit = build_scene(choice, options.scene, scene.path(), run, progress);
  const CheckRequest check{.receivers = options.checked, .rays = options.rays};
  ShadeRequest shade{
      {.scene = scene.path(), .lift = options.scene.lift, .check = check, .run = run}};
  RenderRequest render{
      {.scene = scene.path(), .lift = options.scene.lift, .check = check, .run = run}};
  render.mesh = lit.mesh.triangles.empty() ? nullptr : std::make_shared<const Mesh>(lit.mesh);
  render.camera = lit.camera;
  render.samples = 1;
  const PictureTarget target{.path = picture.path()};
  // Shade each set once for each error asked
  SceneErrors errors{.name = choice.name};
  for (const double asked : options.asked) {
    shade.error = render.error = asked;
    for (const std::string& set : options.sets) {
      shade.count = set == "sparse" ? options.scene.sparse_points : 0;
      const LightingReport report = set == "camera"
                                        ? render_picture(render, std::span(&target, 1), progress)
                                        : shade_container(shade, points.path(), progress);
      errors.rows.push_back(row_of(choice.name, set, report));
    }
  }
  // Climb the ladder of all settings
  const ContainerReader container(scene.path());
  const ThreadPool executor(run.threads);
  errors.surfels = container.superblock().points;
  ShadeOptions settings{.cache_bytes = cache_bytes_left(budget_of(run.memory_bytes, "the ladder"),
                                                        container, executor.threads(),
                                                        executor.threads(), BackEnd::pread)};
  settings.gather.emission = !lit_by_emitters(container);
  const std::vector<Pilot> blocks = blocks_of(container, options.climbed, options.scene.lift);
  progress.begin(choice.name + ", the ladder", 0, "receivers");
  errors.rungs = climb(container, settings, blocks, options.rays / 2, executor, progress);
  progress.end();
  return errors;
}

}  // namespace ptc::bench
