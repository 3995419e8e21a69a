// Each panel varies one thing and keeps the others:
//
//   panel         scene                        varies               compared with
//   surfels       city, growing                surfels              rays, Embree
//   solid-angle   city of middle_points        solid angle          rays
//   depth         sheets of middle_points      number of sheets     rays
//   cap           the largest city             page cache, threads  rays
//
// Scenes of more than ray_reach surfels are shaded without rays.
#include "tools/bench/experiments/growth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "engine/io/file/disk_space.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/run.h"
#include "engine/scene/light/lights.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/shade/shader.h"
#include "engine/sort/spill.h"
#include "tools/bench/experiments/accuracy.h"
#include "tools/bench/experiments/bench_run.h"
#include "tools/bench/references/methods.h"
#include "tools/bench/references/reference.h"
#include "tools/bench/references/timed_runs.h"

namespace ptc::bench {
namespace {

/// A row in which nothing has been measured yet.
GrowthRow row_of(const std::string& panel, double x, const BenchScene& scene,
                 const Executor& executor) {
  return {.panel = panel,
          .x = x,
          .scene = scene.name(),
          .surfels = scene.container().superblock().points,
          .threads = executor.threads(),
          .receivers = scene.sets().front().receivers.size(),
          .us = kNoSpread,
          .wall_us = kNoSpread,
          .occlusion_rms = kNone,
          .irradiance_rms = kNone,
          .speedup_discs = kNone,
          .speedup_mesh = kNone,
          .hit_rate = kNone,
          .pages = kNone,
          .bytes = kNone};
}

/// Shades points of the scene with a page cache of some size that is empty when a run begins.
class CapRun {
 public:
  /// @param share      frames of the cache as a share of all pages
  /// @param max_bytes  upper limit of the cache's bytes, whatever the share
  CapRun(const BenchScene& scene, double share, unsigned threads,
         std::uint64_t max_bytes = std::numeric_limits<std::uint64_t>::max())
      : scene_(scene), executor_(threads), results_(scene.sets().front().receivers.size()) {
    const ContainerReader& container = scene.container();
    const auto frames = static_cast<std::uint64_t>(std::ceil(share * container.page_count()));
    options_.cache_bytes =
        std::max(PageCache::min_bytes(container, threads),
                 std::min(max_bytes, PageCache::bytes_for(container, threads, frames)));
    options_.sky = sky_function(scene.lights().sky);
  }

  void run() {
    Shader shader(scene_.container(), options_, executor_);
    Progress silent;
    costs_.add(timed([&] { shader.shade(scene_.sets().front().receivers, results_, silent); }));
    cache_ = shader.cache_statistics();
  }

  void fill(GrowthRow& row) const {
    const auto count = static_cast<double>(results_.size());
    row.threads = executor_.threads();
    row.us = costs_.cpu_us(results_.size());
    row.wall_us = costs_.wall_us(results_.size());
    row.hit_rate = cache_.hit_rate();
    row.pages = static_cast<double>(cache_.misses) / count;
    row.bytes = static_cast<double>(cache_.bytes_read) / count;
  }
  [[nodiscard]] const std::vector<Shading>& results() const { return results_; }

 private:
  const BenchScene& scene_;
  ThreadPool executor_;
  ShadeOptions options_;
  std::vector<Shading> results_;
  Costs costs_;
  CacheStatistics cache_;
};

/// Some receivers of a scene, and their reference by rays at its discs.
class Truth {
 public:
  Truth(const BenchScene& scene, const GrowthOptions& options, const Executor& executor) {
    const ReceiverSet& set = scene.sets().front();
    checked_ = choose_checked(scene, set, options.checked);
    const DiscRays oracle(scene.surfels(), Sides::both, {});
    const auto trace = [&](const Receiver& r, unsigned rays, std::uint64_t seed) {
      return oracle.trace(r, rays, seed);
    };
    reference_ = make_reference(set, checked_, {.half = options.reference_rays}, trace, executor);
  }

  /// Sets the errors of a row. @param results  shadings of all receivers of the scene
  void compare(const std::vector<Shading>& results, GrowthRow& row) const {
    std::vector<Shading> ours;
    for (const std::size_t i : checked_.receivers) ours.push_back(results[i]);
    row.occlusion_rms = relative_rms(occlusion_of(ours), occlusion_of(reference_.mean));
    row.irradiance_rms = relative_rms(irradiance_of(ours), irradiance_of(reference_.mean));
  }

 private:
  Checked checked_;
  Reference reference_;
};

/// Runs all panels that were asked for.
class GrowthRun : BenchRun<GrowthOptions, GrowthRow> {
 public:
  using BenchRun::BenchRun;

  std::vector<GrowthRow> measure() {
    if (wants("surfels")) {
      for (const std::uint64_t points : options_.points) tell(&GrowthRun::measure_surfels, points);
    }
    if (wants("solid-angle")) tell(&GrowthRun::measure_solid_angles);
    if (wants("depth")) {
      for (const unsigned layers : options_.layers) tell(&GrowthRun::measure_depth, layers);
    }
    if (wants("cap")) tell(&GrowthRun::measure_caps);
    return std::move(rows_);
  }

 private:
  /// Runs a part, and reports all rows so far.
  template <class... Arguments>
  void tell(void (GrowthRun::*part)(Arguments...), Arguments... arguments) {
    (this->*part)(arguments...);
    report();
  }

  [[nodiscard]] bool in_reach(std::uint64_t points) const { return points <= options_.ray_reach; }

  [[nodiscard]] BenchScene make_scene(const SceneChoice& choice, std::uint64_t points) {
    require_room({&work_, 1}, build_disk_bytes(points), fmt::format("{} surfels", points));
    const SceneOptions options{.points = points,
                               .shaded_width = 0,
                               .own_points = options_.own_points,
                               .rays = in_reach(points)};
    return {choice, options, work_, run_, progress_};
  }

  /// Measures time and error at a list of settings, and for "surfels" the time of Embree around
  /// these errors.
  /// @param at  GrowthRow::x of each setting
  void measure_settings(const BenchScene& scene, const std::string& panel,
                        const std::vector<double>& at, const std::vector<GatherOptions>& settings) {
    const std::vector<std::string> methods =
        panel == "surfels" ? std::vector<std::string>{"ptcx", "embree-discs", "embree-mesh"}
                           : std::vector<std::string>{"ptcx"};
    const AccuracyOptions options{.checked = options_.checked,
                                  .reference_rays = options_.reference_rays,
                                  .repeats = options_.repeats,
                                  .methods = methods,
                                  .sets = {"points"},
                                  .settings = settings,
                                  .rays = options_.rays};
    const SceneAccuracy accuracy = measure_accuracy(scene, options, executor_, progress_);
    std::size_t next = 0;
    for (const AccuracyRow& measured : accuracy.rows) {
      if (measured.method != "ptcx" || measured.job != Quantity::bleeding) continue;
      GrowthRow row = row_of(panel, at[next++], scene, executor_);
      row.us = measured.us_per_receiver;
      row.wall_us = measured.wall_us_per_receiver;
      row.occlusion_rms = measured.occlusion.rms;
      row.irradiance_rms = measured.irradiance.rms;
      row.speedup_discs = measured.speedup_discs;
      row.speedup_mesh = measured.speedup_mesh;
      rows_.push_back(row);
    }
  }

  void measure_surfels(std::uint64_t points) {
    const BenchScene scene = make_scene({.name = "city"}, points);
    const auto surfels = static_cast<double>(scene.container().superblock().points);
    if (in_reach(points)) {
      measure_settings(scene, "surfels", {surfels}, {GatherOptions{}});
    } else {
      CapRun run(scene, 1, executor_.threads(), run_.memory_bytes);
      for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) run.run();
      rows_.push_back(row_of("surfels", surfels, scene, executor_));
      run.fill(rows_.back());
    }
  }

  void measure_solid_angles() {
    const BenchScene scene = make_scene({.name = "city"}, options_.middle_points);
    std::vector<GatherOptions> settings;
    std::vector<double> at;
    for (const float solid_angle : options_.solid_angles) {
      settings.push_back({.solid_angle = solid_angle});
      // The decimal that was meant: the float as a double would be 0.0099999998
      at.push_back(std::stod(fmt::format("{}", solid_angle)));
    }
    measure_settings(scene, "solid-angle", at, settings);
  }

  void measure_depth(unsigned layers) {
    const BenchScene scene = make_scene(
        {.name = fmt::format("{} sheets", layers), .layers = layers}, options_.middle_points);
    measure_settings(scene, "depth", {static_cast<double>(layers)}, {GatherOptions{}});
  }

  void measure_caps() {
    // Build the scene, and trace the reference where rays can reach
    const std::uint64_t points = options_.points.back();
    const BenchScene scene = make_scene({.name = "city"}, points);
    std::optional<Truth> truth;
    if (in_reach(points)) truth.emplace(scene, options_, executor_);
    // Shade under all caps in turn
    std::vector<std::unique_ptr<CapRun>> runs;
    for (const unsigned threads : thread_counts(executor_.threads())) {
      for (const double cap : options_.caps)
        runs.push_back(std::make_unique<CapRun>(scene, cap, threads));
    }
    progress_.begin("city, caps", options_.repeats * runs.size(), "runs");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      for (const auto& run : runs) {
        run->run();
        progress_.advance(1);
      }
    }
    progress_.end();
    // Add the rows
    for (std::size_t i = 0; i < runs.size(); ++i) {
      GrowthRow row = row_of("cap", options_.caps[i % options_.caps.size()], scene, executor_);
      runs[i]->fill(row);
      if (truth) truth->compare(runs[i]->results(), row);
      rows_.push_back(row);
    }
  }

  ThreadPool executor_{run_.threads};
};

}  // namespace

std::uint64_t build_disk_bytes(std::uint64_t points) noexcept {
  // Bytes of a point in the spilled records and in the pages of the container
  constexpr std::uint64_t kRecord = kSpilledBytes, kContainer = 64;
  return points * (kRecord + kContainer);
}

std::vector<GrowthRow> measure_growth(
    const GrowthOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<GrowthRow>&)>& report) {
  return GrowthRun(options, work, run, progress, report).measure();
}

}  // namespace ptc::bench
