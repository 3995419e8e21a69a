#include "engine/pipeline/quality/simplification_choice.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/point_error.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/temporary_container.h"

namespace ptc {
namespace {

constexpr unsigned kLeafPoints = 32;             // of a simplified container (spec/notes/leaves.md)
constexpr double kRoundingShare = 0.5;           // of the asked error, that rounding may take
constexpr double kFinestRounding = 8;            // times finer than asked, at most
constexpr double kFirst = 2;                     // coarseness of merging over the asked error
constexpr double kCoarsest = 8, kFinest = 0.25;  // the same
constexpr double kStep = std::numbers::sqrt2;    // from one trial to the next
constexpr double kNear = 1.05;                   // ratio between which nothing is tried

constexpr char kSubject[] = "tolerance";

using RunTrial = std::function<SimplificationTrial(double, double)>;

}  // namespace

void check_tolerance(double asked, Profile profile) {
  require_request(asked > 0 && asked <= 1, kSubject, "`tolerance` is not above 0 and at most 1");
  require_request(is_rounded(profile), kSubject,
                  "a tolerance needs a profile that rounds points: fast or compact");
}

double SimplificationTrial::error() const noexcept {
  return std::max({found.high, light_error, albedo_error});
}

Simplification SimplificationTrial::simplification() const {
  return {.merging = merging_of(merging),
          .rounding = rounding_of(rounding),
          .leaf_points = kLeafPoints};
}

std::string SimplificationChoice::record() const {
  const Flatness flatness = merging_of(taken.merging);
  nlohmann::ordered_json record{
      {"tolerance", asked},         {"error", taken.found.error.relative()},
      {"low", taken.found.low},     {"high", taken.found.high},
      {"light", taken.light_error}, {"albedo", taken.albedo_error}};
  if (taken.merging > 0) {
    record["points"] = taken.merged.points;
    record["merged"] = taken.merged.merged;
    record["made"] = taken.merged.made;
    record["height"] = flatness.height;
    record["turn"] = flatness.turn;
    record["contrast"] = flatness.contrast;
  }
  if (!before.empty()) {
    nlohmann::ordered_json earlier = nlohmann::ordered_json::parse(before, nullptr, false);
    if (earlier.is_object()) record["before"] = std::move(earlier);
  }
  return record.dump();
}

RecodeOptions simplified(RecodeOptions options, const SimplificationChoice& choice) {
  options.simplification = choice.taken.simplification();
  options.simplified = choice.record();
  return options;
}

SimplificationChoice search_simplification(double asked, bool merges, const RunTrial& run) {
  SimplificationChoice choice{.asked = asked};
  const auto trial = [&](double merging, double rounding) {
    choice.trials.push_back(run(merging, rounding));
    return choice.trials.back();
  };
  // Round as coarsely as leaves room for merging
  double rounding = asked;
  choice.taken = trial(0, rounding);
  while (choice.taken.error() > kRoundingShare * asked && rounding > asked / kFinestRounding) {
    rounding /= 2;
    choice.taken = trial(0, rounding);
  }
  choice.met = choice.taken.error() <= asked;
  if (!merges || !choice.met) return choice;
  // Bracket the coarseness of merging
  const auto try_out = [&](double merging) {
    SimplificationTrial found = trial(merging, rounding);
    const bool good = found.error() <= asked;
    if (good) choice.taken = std::move(found);
    return good;
  };
  double at = kFirst * asked;
  if (try_out(at)) {
    do at *= kStep;
    while (at <= kCoarsest * asked && try_out(at));
    if (at > kCoarsest * asked) return choice;
  } else {
    do at /= kStep;
    while (at >= kFinest * asked && !try_out(at));
    if (at < kFinest * asked) return choice;
    at *= kStep;
  }
  // `at` is too coarse, and a step below is not
  for (double step = std::sqrt(kStep); step > kNear; step = std::sqrt(step)) {
    if (!try_out(at / step)) at /= step;
  }
  return choice;
}

SimplificationChoice choose_simplification(const ContainerReader& container, double asked,
                                           RecodeOptions options,
                                           const std::filesystem::path& target,
                                           StageSeconds& seconds, Progress& progress) {
  check_tolerance(asked, options.profile);
  const bool merges = container.meta().channels.empty();
  if (!merges) {
    progress.note(
        "the container has channels, which have values for each of its points: the "
        "points are stored less exactly, and none are merged");
  }
  const auto earlier = container.meta().text.find(kSimplifiedKey);
  if (earlier != container.meta().text.end()) {
    progress.note("the container is simplified already: the error comes on top of what it has");
  }
  constexpr std::size_t kRecordBytes = 1024;  // of kSimplifiedKey and a longer kRoundingKey
  check_meta(container.meta(), options.page_shift.value_or(container.header().page_shift),
             container.header().point_bytes, kRecordBytes);
  const ThreadPool executor(options.run.threads);
  const Stage stage(seconds, progress, "choose what to keep", 0, "points");
  PointJudge judge(container, options.run, target, executor);
  SimplificationChoice choice =
      search_simplification(asked, merges, [&](double merging, double rounding) {
        SimplificationTrial trial{.merging = merging, .rounding = rounding};
        options.simplification = trial.simplification();
        options.simplified = fmt::format("{} {}", merging, rounding);  // names the trial
        Progress silent;
        const auto made = make_temporary_container(
            roomiest_temp_dir(options.run, target), [&](const std::filesystem::path& path) {
              trial.merged = recode_container(container, path, options, silent).merged;
            });
        return_freed_memory();
        trial.points = made->superblock().points;
        trial.bytes = made->superblock().file_bytes;
        trial.found = judge.measure(*made);
        trial.light_error =
            std::hypot(trial.merged.light_error(), light_error(options.simplification->rounding));
        trial.albedo_error = trial.merged.albedo_error();
        progress.advance(container.superblock().points);
        return trial;
      });
  if (earlier != container.meta().text.end()) choice.before = earlier->second;
  if (!choice.met) {
    progress.note(
        fmt::format("a tolerance of {:.3g} % is not met: the finest rounding is {:.3g} % off",
                    100 * asked, 100 * choice.taken.error()));
  }
  return choice;
}

SimplifiedBuild build_within(BuildRequest request, std::optional<double> asked,
                             const std::filesystem::path& target, Progress& progress) {
  if (!asked) return {.report = build_container(request, target, progress)};
  require_request(!request.resume && request.append.empty(), kSubject,
                  "`tolerance` excludes `resume` and `append`: build the container first, and "
                  "simplify it then");
  check_tolerance(*asked, request.profile);
  const RecodeOptions options{
      .profile = request.profile, .page_shift = request.page_shift, .run = request.run};
  request.profile = Profile::exact;
  SimplifiedBuild made;
  const auto exact = make_temporary_container(
      roomiest_temp_dir(request.run, target), [&](const std::filesystem::path& path) {
        made.report = build_container(request, path, progress);
      });
  return_freed_memory();
  made.choice =
      choose_simplification(*exact, *asked, options, target, made.report.seconds, progress);
  const ConvertReport written =
      recode_container(*exact, target, simplified(options, *made.choice), progress);
  made.report.superblock = *written.superblock;
  made.report.seconds.insert(made.report.seconds.end(), written.seconds.begin(),
                             written.seconds.end());
  return made;
}

}  // namespace ptc
