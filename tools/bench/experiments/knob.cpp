#include "tools/bench/experiments/knob.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/quality/candidates.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/scene_record.h"
#include "engine/scene/light/sky_map.h"
#include "engine/trace/disc_visibility.h"
#include "engine/trace/ray_shader.h"

namespace ptc::bench {
namespace {

// Seeds of the rays that settings are judged by, and of rays that shade receivers: far from those
// of pilots
constexpr std::uint64_t kJudgeSeed = std::uint64_t{1} << 50, kRaySeed = std::uint64_t{1} << 51;
constexpr double kJudgePhase = 0.77;  // of the receivers that judge, in other stretches

using Blocks = std::vector<std::vector<Receiver>>;

/// Cuts receivers into the blocks in which a shader shades them, 2^16 at a time.
Blocks blocks_of(const Frame& frame, std::span<const Receiver> receivers,
                 const Executor& executor) {
  constexpr std::size_t kAtOnce = 1 << 16;
  Blocks blocks;
  for (std::size_t first = 0; first < receivers.size(); first += kAtOnce) {
    const auto some = receivers.subspan(first, std::min(kAtOnce, receivers.size() - first));
    const std::vector<std::size_t> order = order_along_curve(frame, some, 0, executor);
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (i % Shader::kBlock == 0) blocks.emplace_back();
      blocks.back().push_back(some[order[i]]);
    }
  }
  return blocks;
}

/// Makes pilots of blocks. @param count  of the pilots, about
std::vector<Pilot> pilots_of(const Blocks& blocks, std::size_t count, double phase) {
  std::vector<Pilot> pilots;
  for (const std::vector<Receiver>& block : blocks)
    add_pilots(pilots, block, 0, (count + blocks.size() - 1) / blocks.size(), 1, phase);
  return pilots;
}

/// Judges settings at receivers of a run.
class KnobJudge {
 public:
  KnobJudge(const ContainerReader& scene, const ShadeOptions& options, std::vector<Pilot> pilots,
            unsigned rays, const Executor& executor)
      : scene_(scene),
        view_(scene),
        options_(options),
        pilots_(std::move(pilots)),
        executor_(executor) {
    const auto coarse = shade(kSurveyed[0], true), fine = shade(kSurveyed[1], true);
    choose_compared(pilots_, coarse, fine);
    const std::vector<Receiver> twice = two_of_each(compared_of(pilots_));
    traced_.resize(twice.size());
    RayShader discs(scene_, ray_options(options_), executor_);
    discs.trace(twice, rays / 2, kJudgeSeed, traced_, silent_);
  }

  /// Returns the error at a setting of the ladder.
  double error_of(std::size_t setting) {
    const auto [found, added] = errors_.try_emplace(setting);
    if (added) {
      const auto results = shade(setting, false);
      std::vector<Shading> all;
      for (const auto& some : results) all.insert(all.end(), some.begin(), some.end());
      found->second = compare(all);
    }
    return found->second;
  }
  /// Returns the cost of a receiver at a setting, as counts tell it.
  double cost_of(std::size_t setting) {
    static_cast<void>(error_of(setting));
    return gather_cost(ladder()[setting], works_[setting]);
  }
  /// Returns the error of rays.
  double error_of_rays(unsigned rays) {
    const auto [found, added] = ray_errors_.try_emplace(rays);
    if (added) {
      const std::vector<Receiver> receivers = compared_of(pilots_);
      std::vector<Shading> results(receivers.size());
      RayShader discs(scene_, ray_options(options_), executor_);
      discs.trace(receivers, rays, kRaySeed, results, silent_);
      found->second = compare(results);
    }
    return found->second;
  }

 private:
  /// Shades receivers of all pilots. @param candidates  all of them, or those that are compared
  std::vector<std::vector<Shading>> shade(std::size_t setting, bool candidates) {
    PageCache cache(scene_, {.memory_bytes = options_.cache_bytes,
                             .threads = executor_.threads() * options_.readers()});
    std::vector<std::vector<Compared>> some;
    for (const Pilot& pilot : pilots_)
      some.push_back(candidates ? candidates_of(pilot) : pilot.compared);
    const auto of = [&](std::size_t i) -> std::span<const Compared> { return some[i]; };
    ShadedPilots shaded =
        shade_pilots(view_, cache, options_, ladder()[setting].options(options_.gather), pilots_,
                     every_pilot(pilots_), of, executor_);
    if (!candidates) {
      for (const GatherWork& work : shaded.works) works_[setting].add(work);
    }
    return std::move(shaded.results);
  }

  [[nodiscard]] double compare(std::span<const Shading> results) const {
    ErrorSums sums;
    std::size_t i = 0;
    for (const Pilot& pilot : pilots_) {
      for (const Compared& one : pilot.compared) {
        sums.add(results[i], traced_[2 * i], traced_[2 * i + 1], one.weight);
        ++i;
      }
    }
    return sums.error().relative();
  }

  const ContainerReader& scene_;
  const SceneView view_;
  const ShadeOptions& options_;
  std::vector<Pilot> pilots_;
  const Executor& executor_;
  Progress silent_;
  std::vector<Shading> traced_;
  std::map<std::size_t, GatherWork> works_;
  std::map<std::size_t, double> errors_;
  std::map<unsigned, double> ray_errors_;
};

}  // namespace

std::size_t KnobRow::missed() const {
  return static_cast<std::size_t>(std::ranges::count_if(
      choices, [&](const KnobChoice& c) { return c.tuning.met && c.error > asked; }));
}

std::size_t KnobRow::refused() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(choices, [](const KnobChoice& c) { return !c.tuning.met; }));
}

std::size_t KnobRow::outside() const {
  return static_cast<std::size_t>(std::ranges::count_if(choices, [](const KnobChoice& c) {
    return c.error < c.tuning.low || c.error > c.tuning.high;
  }));
}

std::vector<KnobRow> measure_knob(const SceneChoice& choice, const KnobOptions& options,
                                  const std::filesystem::path& work, const RunOptions& run,
                                  Progress& progress) {
  const BenchScene scene(choice, options.scene, work, run, progress);
  const ThreadPool executor(run.threads);
  const ContainerReader& container = scene.container();
  ShadeOptions shade{.sky = sky_function(scene.lights().sky),
                     .visibility = disc_visibility(Sides::both)};
  shade.gather.emission = !lit_by_emitters(container);
  shade.cache_bytes =
      cache_bytes_left(budget_of(run.memory_bytes, "the knob"), container, executor.threads(),
                       shade.readers() * executor.threads(), BackEnd::pread);
  std::vector<KnobRow> rows;
  for (const ReceiverSet& set : scene.sets()) {
    if (std::ranges::find(options.sets, set.name) == options.sets.end()) continue;
    if (set.receivers.empty()) continue;
    const Blocks blocks = blocks_of(container.header().frame, set.receivers, executor);
    const std::size_t judged = options.checked / Pilot::kCompared;
    progress.begin(choice.name + ", " + set.name, options.asked.size() * options.seeds, "choices");
    KnobJudge judge(container, shade, pilots_of(blocks, judged, kJudgePhase), options.rays,
                    executor);
    for (const double asked : options.asked) {
      KnobRow row{.scene = choice.name, .set = set.name, .asked = asked};
      for (unsigned seed = 0; seed < options.seeds; ++seed) {
        const PilotPlan plan = plan_pilots(set.receivers.size(), Shader::kBlock);
        std::vector<Pilot> pilots =
            pilots_of(blocks, plan.blocks * plan.stretches, (seed + 0.5) / options.seeds);
        std::vector<Shading> traced;
        Progress silent;
        KnobChoice& made = row.choices.emplace_back();
        made.tuning = tune(container, shade, asked, true, pilots, executor, silent, traced);
        const std::size_t setting = made.tuning.setting;
        const unsigned rays = made.tuning.receiver_rays;
        made.error = rays > 0 ? judge.error_of_rays(rays) : judge.error_of(setting);
        made.cost = rays > 0 ? ray_cost(rays) : judge.cost_of(setting);
        progress.advance(1);
      }
      // Compare with all settings
      for (std::size_t i = 0; i < ladder().size(); ++i) {
        const double error = judge.error_of(i), cost = judge.cost_of(i);
        if (error <= asked) row.least_cost = std::min(cost, row.least_cost.value_or(cost));
        for (KnobChoice& made : row.choices)
          made.is_dominated = made.is_dominated || (cost < made.cost && error < made.error);
      }
      rows.push_back(std::move(row));
    }
    progress.end();
  }
  return rows;
}

}  // namespace ptc::bench
