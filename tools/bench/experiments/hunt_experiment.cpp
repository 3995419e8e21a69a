// The experiment `ptcbench hunt`: its tables, its chart and its options.
#include <algorithm>
#include <memory>

#include <fmt/format.h>

#include "engine/parallel/thread_pool.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/hunt/hunt.h"
#include "tools/bench/hunt/kept_scenes.h"

namespace ptc::bench {
namespace {

constexpr char kHuntReading[] =
    "Small scenes that are drawn by chance: one to six walls, sheets of two sides, pairs of walls, "
    "wedges, walls with slits, boxes, rooms, balls, discs, leaves and rods, with spacings of up to "
    "16 to 1 beside one another, 250 to 3,500 surfels in all, black, white or coloured, with a sky "
    "or without. Each has 48 receivers, on its surfaces and off them. They are shaded with the "
    "default settings and compared with rays at the same discs, twice each, so that the noise of "
    "the rays is not part of the errors. Errors are shares of white, 1 where white surrounds a "
    "receiver, but those over the mean light of a scene. 0 would be right everywhere. The worst "
    "scenes are shrunk while the error stays at 80 % of what it was or more.";

constexpr std::array kShares{0.5, 0.9, 0.99, 0.999, 1.0};

/// How one kind of error is spread over the scenes.
struct SpreadRow {
  std::string error;
  std::array<double, kShares.size()> at{};
};

/// A kept scene as it is now.
struct KeptRow {
  KeptScene kept;
  double error = 0;
};

std::vector<double> sorted_errors(const Bag& bag, HuntError kind) {
  std::vector<double> errors;
  for (const Judgement& judgement : bag.judgements) errors.push_back(judgement[kind]);
  std::ranges::sort(errors);
  return errors;
}

Table spread_table(const Bag& bag) {
  using R = SpreadRow;
  std::vector<R> rows;
  for (const HuntError kind : kHuntErrors) {
    const std::vector<double> errors = sorted_errors(bag, kind);
    R& row = rows.emplace_back(R{.error = name_of(kind)});
    for (std::size_t i = 0; i < kShares.size(); ++i) row.at[i] = quantile(errors, kShares[i]);
  }
  Columns<R> columns{{"error", {"error of a scene"}, &R::error}};
  constexpr std::array kNames{"median", "percentile_90", "percentile_99", "percentile_99_9",
                              "worst"};
  constexpr std::array kHeadings{"median %", "90 % of scenes", "99 %", "99.9 %", "worst"};
  for (std::size_t i = 0; i < kShares.size(); ++i)
    columns.emplace_back(kNames[i], percent(kHeadings[i], "{:.2f}"),
                         [i](const R& r) { return r.at[i]; });
  return tabulate<R>({.name = "rows", .title = "Errors of the scenes"}, columns, rows);
}

Table kept_table(const std::vector<KeptRow>& rows) {
  using R = KeptRow;
  const Columns<R> columns{
      {"name", {"scene"}, [](const R& r) { return std::string(r.kept.name); }},
      {"seed", {"seed"}, path(&R::kept, &KeptScene::seed)},
      {"kind", {"error"}, [](const R& r) { return std::string(name_of(r.kept.kind)); }},
      {"value", percent("measured %", "{:.1f}"), &R::error},
      {"bound", percent("bound %", "{:.0f}"), path(&R::kept, &KeptScene::bound)},
      {"holds",
       {"holds"},
       [](const R& r) { return std::string(r.error <= r.kept.bound ? "yes" : "NO"); }},
      {"why", {"what goes wrong"}, [](const R& r) { return std::string(r.kept.why); }},
      {"text", {}, [](const R& r) { return std::string(r.kept.text); }}};
  return tabulate<R>({.name = "kept", .title = "Scenes that are kept"}, columns, rows);
}

Table worst_table(const std::vector<Prey>& worst) {
  using R = Prey;
  const Columns<R> columns{
      {"seed", {"seed"}, &R::seed},
      {"kind", {"error"}, [](const R& r) { return std::string(name_of(r.kind)); }},
      {"value", percent("as drawn %", "{:.1f}"), &R::error},
      {"shrunk", percent("shrunk %", "{:.1f}"), &R::shrunk},
      {"shapes", {"shapes that are left"}, [](const R& r) { return kinds_of(r.scene); }},
      {"receivers", {"receivers"}, [](const R& r) { return r.scene.receivers.size(); }},
      {"text", {}, [](const R& r) { return text_of(r.scene); }}};
  return tabulate<R>({.name = "worst", .title = "The worst of this hunt"}, columns, worst);
}

/// The share of scenes whose error is above a value, against that value.
Chart tail_chart(const Bag& bag) {
  Chart chart{.title = "Scenes by their errors", .note = kHuntReading, .columns = 1};
  ChartPanel panel{.title = "Share of scenes with a larger error",
                   .x_label = "error, %",
                   .y_label = "share of scenes, %"};
  for (const HuntError kind : kHuntErrors) {
    const std::vector<double> errors = sorted_errors(bag, kind);
    const auto count = static_cast<double>(errors.size());
    ChartSeries& series = series_of(panel, name_of(kind), false);
    // Equal steps of the logarithm of the share
    for (double above = count / 2; above >= 1; above /= 1.3) {
      const double share = std::floor(above) / count;
      series.points.push_back({.x = 100 * quantile(errors, 1 - share), .y = 100 * share});
    }
  }
  add_panel(chart, std::move(panel));
  return chart;
}

Report report_of(const Bag& bag, const std::vector<KeptRow>& kept) {
  Report report{.name = "hunt",
                .title = "Scenes drawn by chance",
                .reading = kHuntReading,
                .runs = 0,
                .tables = {}};
  report.tables.push_back(spread_table(bag));
  if (!kept.empty()) report.tables.push_back(kept_table(kept));
  if (!bag.worst.empty()) report.tables.push_back(worst_table(bag.worst));
  double noise = 0;
  for (const Judgement& judgement : bag.judgements) noise = std::max(noise, judgement.noise);
  report.notes.push_back(fmt::format(
      "{} scenes. {} of them gave results that cannot be: no numbers, occlusion outside of 0 to 1, "
      "light below 0 or above white. {} gave other results on another number of threads. The noise "
      "of the rays at a receiver is at most {:.2f} % of white (RMS of a scene).",
      bag.judgements.size(), bag.unsound.size(), bag.uneven.size(), 100 * noise));
  report.figures.push_back({.chart = tail_chart(bag)});
  return report;
}

}  // namespace

Experiment make_hunt_experiment() {
  const auto options = std::make_shared<HuntOptions>();
  const auto run = [=](const Bench& b) {
    const ThreadPool executor(b.run.threads);
    const Lab lab{b.work, executor};
    std::vector<KeptRow> kept;
    for (const KeptScene& scene : kept_scenes())
      kept.push_back({scene, judge(scene_of(scene.text), lab, options->close_rays)[scene.kind]});
    return report_of(hunt(*options, lab, b.progress), kept);
  };
  return {
      .name = "hunt",
      .purpose = "Errors of small scenes that are drawn by chance, the worst of them made smaller",
      .quick = "Some seconds: 20 scenes, the worst of which is made smaller",
      .declare =
          [=](Declaration& d) {
            d.count("--scenes", options->scenes, "Scenes to draw", "10k");
            d.quick("--scenes", options->scenes, 20);
            d.integer("--first", options->first, 0, 1'000'000'000'000, "Seed of the first scene");
            d.integer("--rays", options->rays, 16, 65536, "Rays for each receiver, twice");
            d.integer("--worst", options->worst, 0, 1000,
                      "Scenes to make smaller, of each kind of error");
            d.quick("--worst", options->worst, 1);
            d.quick(options->budget, 20);
            d.quick(options->close_rays, 1024);
          },
      .run = run};
}

}  // namespace ptc::bench
