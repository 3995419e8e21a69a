#include "engine/pipeline/quality/surfel_choice.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <ranges>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/temporary_container.h"

namespace ptc {
namespace {

constexpr std::uint64_t kFirstCount = 16'384, kFewestCount = 256,
                        kMostCount = 100'000'000;  // surfels
// Growth from one trial to the next, at least and at most: a power of how far the error is above
// what is asked, as errors fall on most meshes
constexpr double kGrowthPower = 1.5, kLeastGrowth = 1.5, kMostGrowth = 4;
constexpr double kNearCount = 1.2;  // ratio of numbers between which nothing is tried
constexpr double kBetter = 0.95;    // of the even error, below which the spacing adapts
// The error has stopped falling when it is still that share of one with a sixteenth of the surfels
constexpr double kStalled = 0.8, kStalledOver = 16;
constexpr double kAsGood = 1.05;  // times the least error

constexpr char kNoRoom[] =
    "the number of surfels can be chosen only where the meshes fit in memory, beside what their "
    "sampling takes";

std::uint64_t rounded(double count) {
  return std::clamp(static_cast<std::uint64_t>(std::llround(count)), kFewestCount, kMostCount);
}

using RunSurfelTrial = std::function<SurfelTrial(std::uint64_t, bool)>;

/// The trials of a search: the first two tell whether the spacing adapts in all others.
class Search {
 public:
  Search(double asked, const RunSurfelTrial& run_trial)
      : run_trial_(run_trial), choice_{.asked = asked} {}

  SurfelChoice run() {
    // Take the better spacing
    const SurfelTrial even = trial(kFirstCount, false), adapted = trial(kFirstCount, true);
    adapts_ = adapted.found.error.relative() < kBetter * even.found.error.relative();
    const SurfelTrial& first = adapts_ ? adapted : even;
    // Bracket the number
    std::optional<SurfelTrial> good, bad;
    (is_good(first) ? good : bad) = first;
    while (!good && bad->count < kMostCount && !has_stalled()) take(more_than(*bad), good, bad);
    while (!bad && good->count > kFewestCount)
      take(rounded(static_cast<double>(good->count) / kMostGrowth), good, bad);
    // Close in on it
    while (good && bad &&
           static_cast<double>(good->count) > kNearCount * static_cast<double>(bad->count))
      take(rounded(std::sqrt(static_cast<double>(good->count) * static_cast<double>(bad->count))),
           good, bad);
    choice_.met = good.has_value();
    choice_.taken = good ? *good : as_good_as_best();
    return std::move(choice_);
  }

 private:
  [[nodiscard]] bool is_good(const SurfelTrial& trial) const {
    return trial.found.high <= choice_.asked;
  }

  SurfelTrial trial(std::uint64_t count, bool adapts) {
    choice_.trials.push_back(run_trial_(count, adapts));
    return choice_.trials.back();
  }

  void take(std::uint64_t count, std::optional<SurfelTrial>& good,
            std::optional<SurfelTrial>& bad) {
    const SurfelTrial found = trial(count, adapts_);
    (is_good(found) ? good : bad) = found;
  }

  /// Returns the number of surfels to try after one that is too small.
  [[nodiscard]] std::uint64_t more_than(const SurfelTrial& bad) const {
    const double growth = std::pow(bad.found.high / choice_.asked, kGrowthPower);
    return rounded(static_cast<double>(bad.count) * std::clamp(growth, kLeastGrowth, kMostGrowth));
  }

  /// Says whether the error is about that of far fewer surfels.
  [[nodiscard]] bool has_stalled() const {
    const SurfelTrial& last = choice_.trials.back();
    return std::ranges::any_of(choice_.trials, [&](const SurfelTrial& trial) {
      return trial.adapts == adapts_ &&
             kStalledOver * static_cast<double>(trial.count) <= static_cast<double>(last.count) &&
             last.found.high >= kStalled * trial.found.high;
    });
  }

  /// Returns the trial with the fewest surfels whose error is about the least.
  [[nodiscard]] SurfelTrial as_good_as_best() const {
    const auto high = [](const SurfelTrial& trial) { return trial.found.high; };
    auto same = choice_.trials | std::views::filter([&](const SurfelTrial& trial) {
                  return trial.adapts == adapts_;
                });
    const double most = kAsGood * high(std::ranges::min(same, {}, high));
    auto as_good =
        same | std::views::filter([&](const SurfelTrial& trial) { return high(trial) <= most; });
    return std::ranges::min(as_good, {}, &SurfelTrial::count);
  }

  const RunSurfelTrial& run_trial_;
  SurfelChoice choice_;
  bool adapts_ = false;
};

}  // namespace

SurfelTrials::SurfelTrials(const BuildRequest& request, const std::filesystem::path& target)
    : request_(request),
      target_(target),
      executor_(request.run.threads),
      judge_(request_, target_, executor_) {
  const std::vector<std::filesystem::path> files =
      object_files(request.inputs, request.run.memory_bytes);
  require_request(request.append.empty() && request.city_points == 0 &&
                      std::ranges::none_of(files, holds_points) && (request.mesh || !files.empty()),
                  "error", "the number of surfels can be chosen where all inputs are meshes");
  request_.resume = false;
  request_.sampling.spacing = 0;
}

SurfelTrial SurfelTrials::run(std::uint64_t count, bool adapts) {
  request_.sampling.count = count;
  request_.sampling.adapts = adapts;
  SurfelTrial trial{.count = count, .adapts = adapts};
  Progress silent;
  const double before = cpu_seconds();
  const auto scene = make_temporary_container(
      roomiest_temp_dir(request_.run, target_), [&](const std::filesystem::path& path) {
        // Meshes that stream are spaced evenly and lit by rays at their surfels
        require_request(!build_container(request_, path, silent).streamed, "error", kNoRoom);
      });
  trial.cpu_seconds = cpu_seconds() - before;
  return_freed_memory();
  trial.points = scene->superblock().points;
  trial.bytes = scene->superblock().file_bytes;
  trial.found = judge_.measure(*scene);
  return trial;
}

SurfelChoice search_surfels(double asked, const RunSurfelTrial& run) {
  return Search(asked, run).run();
}

SurfelChoice choose_surfels(const BuildRequest& request, double asked,
                            const std::filesystem::path& target, StageSeconds& seconds,
                            Progress& progress) {
  require_request(asked > 0 && asked <= 1, "error", "`error` is not above 0 and at most 1");
  SurfelTrials trials(request, target);
  SurfelChoice choice;
  {
    const Stage stage(seconds, progress, "choose surfels", 0, "surfels");
    choice = search_surfels(asked, [&](std::uint64_t count, bool adapts) {
      SurfelTrial trial = trials.run(count, adapts);
      progress.advance(trial.points);
      return trial;
    });
  }
  if (!choice.met) {
    const SurfelTrial& taken = choice.taken;
    std::uint64_t most = 0;
    for (const SurfelTrial& trial : choice.trials) {
      if (trial.adapts == taken.adapts) most = std::max(most, trial.points);
    }
    progress.note(fmt::format(
        "an error of {:.3g} % is not {}: with {} surfels it is {:.3g} % [{:.3g}, {:.3g}]{}",
        100 * asked, taken.found.error.relative() > asked ? "met" : "confirmed", taken.points,
        100 * taken.found.error.relative(), 100 * taken.found.low, 100 * taken.found.high,
        most > taken.points ? fmt::format(", and up to {} make it hardly smaller", most) : ""));
  }
  return choice;
}

}  // namespace ptc
