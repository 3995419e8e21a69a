#include "tools/bench/experiments/surfels.h"

#include <cmath>
#include <utility>

#include "engine/ptc.h"

namespace ptc::bench {
namespace {

/// Returns the CPU times of the gathers of some pictures of the mesh, seconds.
Spread picture_cpu(const BuildRequest& request, const SurfelsOptions& options,
                   const std::filesystem::path& work) {
  Progress silent;
  RenderRequest picture;
  picture.scene = work / "surfels.ptcx";
  picture.error = options.asked;
  picture.meshes = request.inputs;
  picture.mesh = request.mesh;
  picture.backdrop = request.backdrop;
  picture.size = {options.width, options.height};
  picture.run = request.run;
  build_container(request, picture.scene, silent);
  std::vector<double> seconds;
  const std::vector<PictureTarget> targets{{.path = work / "surfels.exr"}};
  for (unsigned i = 0; i < options.repeats; ++i)
    seconds.push_back(render_picture(picture, targets, silent).shade_cpu_seconds);
  std::filesystem::remove(picture.scene);
  std::filesystem::remove(targets.front().path);
  return spread_of(std::move(seconds));
}

}  // namespace

SurfelsNeed need_of(const std::vector<SurfelTrial>& trials, double asked) {
  const auto error = [](const SurfelTrial& t) { return t.found.error.relative(); };
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const SurfelTrial& to = trials[i];
    if (error(to) > asked) continue;
    const auto points = static_cast<double>(to.points), bytes = static_cast<double>(to.bytes);
    if (i == 0) return {.surfels = points, .bytes = bytes};
    const SurfelTrial& from = trials[i - 1];
    const double share =
        error(to) > 0 ? std::log(error(from) / asked) / std::log(error(from) / error(to)) : 1;
    const auto between = [share](double a, double b) { return a * std::pow(b / a, share); };
    return {.surfels = between(static_cast<double>(from.points), points),
            .bytes = between(static_cast<double>(from.bytes), bytes)};
  }
  return {};
}

SurfelsScene measure_surfels(const SceneChoice& choice, const SurfelsOptions& options,
                             const std::filesystem::path& work, const RunOptions& run,
                             Progress& progress) {
  BuildRequest request = request_scene(choice, {}, run).build;
  SurfelTrials trials(request, work / "surfels.ptcx");
  SurfelsScene scene{.needs = {.scene = choice.name, .asked = options.asked}};
  progress.begin(choice.name, 2 * options.counts.size(), "containers");
  for (const bool adapts : {false, true}) {
    std::vector<SurfelTrial> of_this;
    for (const std::uint64_t count : options.counts) {
      of_this.push_back(trials.run(count, adapts));
      scene.rows.push_back({choice.name, of_this.back()});
      progress.advance(1);
    }
    SurfelsNeed& need = adapts ? scene.needs.adapted : scene.needs.even;
    need = need_of(of_this, options.asked);
    if (std::isnan(need.surfels)) continue;
    request.sampling.count = static_cast<std::uint64_t>(std::llround(need.surfels));
    request.sampling.adapts = adapts;
    need.picture_cpu = picture_cpu(request, options, work);
  }
  progress.end();
  return scene;
}

}  // namespace ptc::bench
