#include "tools/bench/experiments/tolerance.h"

#include <system_error>
#include <utility>

#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/point_error.h"
#include "engine/ptc.h"

namespace ptc::bench {
namespace {

/// Measures the containers of a scene.
class ToleranceRun {
 public:
  ToleranceRun(const SceneChoice& choice, const ToleranceOptions& options,
               const std::filesystem::path& work, const RunOptions& run)
      : options_(options), work_(work), run_(run), scene_(choice.name) {
    BuildRequest request = request_scene(choice, {.points = options.points}, run).build;
    request.profile = Profile::exact;
    Progress silent;
    build_container(request, exact_path_, silent);
  }

  ToleranceRun(const ToleranceRun&) = delete;
  ToleranceRun& operator=(const ToleranceRun&) = delete;
  ~ToleranceRun() {
    std::error_code ignored;
    for (const auto& file : {exact_path_, path_, shaded_path_})
      std::filesystem::remove(file, ignored);
  }

  ToleranceRow compact() {
    const ContainerReader exact(exact_path_);
    Progress silent;
    recode_container(exact, path_, {.profile = Profile::compact, .run = run_}, silent);
    const ThreadPool executor(run_.threads);
    ToleranceRow row = row_of();
    row.found.found = PointJudge(exact, run_, path_, executor).measure(ContainerReader(path_));
    row.found.light_error = light_error(PointRounding{});
    compact_bytes_ = row.bytes;
    return row;
  }

  ToleranceRow with(double tolerance) {
    const ContainerReader exact(exact_path_);
    Progress silent;
    StageSeconds seconds;
    const RecodeOptions options{.profile = Profile::compact, .run = run_};
    const SimplificationChoice choice =
        choose_simplification(exact, tolerance, options, path_, seconds, silent);
    recode_container(exact, path_, simplified(options, choice), silent);
    ToleranceRow row = row_of();
    row.tolerance = tolerance;
    row.found = choice.taken;
    for (const auto& stage : seconds) row.choosing += stage.second;
    return row;
  }

 private:
  /// Returns what the container that was written last has and takes, without its error.
  ToleranceRow row_of() {
    ToleranceRow row{.scene = scene_};
    {
      const ContainerReader made(path_);
      row.points = made.superblock().points;
      row.bytes = made.superblock().file_bytes;
    }
    const auto all = static_cast<double>(ContainerReader(exact_path_).superblock().points);
    row.bytes_per_point = static_cast<double>(row.bytes) / all;
    if (compact_bytes_ > 0)
      row.ratio = static_cast<double>(row.bytes) / static_cast<double>(compact_bytes_);
    // Shade the same receivers
    ShadeRequest request;
    request.scene = path_;
    request.receivers = exact_path_;
    request.count = options_.receivers;
    request.run = run_;
    Progress silent;
    std::vector<double> times;
    for (unsigned i = 0; i < options_.repeats; ++i) {
      const LightingReport report = shade_container(request, shaded_path_, silent);
      times.push_back(1e6 * report.shade_cpu_seconds / static_cast<double>(report.receivers));
    }
    row.shading = spread_of(std::move(times));
    return row;
  }

  const ToleranceOptions& options_;
  std::filesystem::path work_;
  RunOptions run_;
  std::string scene_;
  std::filesystem::path exact_path_ = work_ / "exact.ptcx", path_ = work_ / "stored.ptcx",
                        shaded_path_ = work_ / "shaded.ply";
  std::uint64_t compact_bytes_ = 0;
};

}  // namespace

ToleranceScene measure_tolerance(const SceneChoice& choice, const ToleranceOptions& options,
                                 const std::filesystem::path& work, const RunOptions& run,
                                 Progress& progress) {
  progress.begin(choice.name, 1 + options.tolerances.size(), "containers");
  ToleranceRun measured(choice, options, work, run);
  ToleranceScene scene;
  scene.rows.push_back(measured.compact());
  progress.advance(1);
  for (const double tolerance : options.tolerances) {
    scene.rows.push_back(measured.with(tolerance));
    progress.advance(1);
  }
  progress.end();
  return scene;
}

}  // namespace ptc::bench
