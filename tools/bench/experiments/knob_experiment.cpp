// The experiment `ptcbench knob`: its table, its chart and its options.
#include <algorithm>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "tools/bench/chart/statistics.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/knob.h"

namespace ptc::bench {
namespace {

constexpr char kKnobReading[] =
    "Whether --error keeps its word. A setting is chosen from several choices of pilots (seeds), "
    "and its error is measured at thousands of other receivers: the largest of those of occlusion, "
    "irradiance and sky, root mean square over the mean, against rays at the same surfels. "
    "*Missed* "
    "are choices that were said to meet what was asked and do not; *refused*, choices that were "
    "told not to meet it, or not to be sure. The interval that is told is meant to hold the error "
    "in nine of ten choices. Costs are told from counts of the work, microseconds of CPU for a "
    "receiver; the least one is that of the cheapest setting of the gather that meets what is "
    "asked. *Dominated* are choices beside which another setting is cheaper and more exact.";

/// Returns a value in the middle of those of all choices.
template <class Value>
double middle(const KnobRow& row, const Value& value) {
  std::vector<double> values;
  for (const KnobChoice& choice : row.choices) values.push_back(value(choice));
  return spread_of(std::move(values)).median;
}

const Columns<KnobRow>& knob_columns() {
  using R = KnobRow;
  const auto over = [](const R& r, bool largest) {
    double result = largest ? 0 : 1e9;
    for (const KnobChoice& c : r.choices)
      result = largest ? std::max(result, c.error) : std::min(result, c.error);
    return result;
  };
  static const Columns<R> columns{
      {"scene", {"scene"}, &R::scene},
      {"set", {"receivers"}, &R::set},
      {"asked", percent("asked %", "{:.4g}"), &R::asked},
      {"choices", {"seeds"}, [](const R& r) { return r.choices.size(); }},
      {"missed", {"missed"}, &R::missed},
      {"refused", {"refused"}, &R::refused},
      {"outside", {"outside the interval"}, &R::outside},
      {"dominated",
       {"dominated"},
       [](const R& r) {
         return static_cast<std::size_t>(
             std::ranges::count_if(r.choices, &KnobChoice::is_dominated));
       }},
      {"error", percent("measured %, median"),
       [](const R& r) { return middle(r, [](const KnobChoice& c) { return c.error; }); }},
      {"least_error", percent("least %"), [=](const R& r) { return over(r, false); }},
      {"largest_error", percent("largest %"), [=](const R& r) { return over(r, true); }},
      {"by_rays",
       {"by rays"},
       [](const R& r) {
         return static_cast<std::size_t>(std::ranges::count_if(
             r.choices, [](const KnobChoice& c) { return c.tuning.receiver_rays > 0; }));
       }},
      {"cost",
       {"us/receiver", "{:.0f}"},
       [](const R& r) { return middle(r, [](const KnobChoice& c) { return c.cost; }); }},
      {"least_cost",
       {"least us", "{:.0f}"},
       [](const R& r) { return r.least_cost ? Value(*r.least_cost) : Value(); }},
      {"pilot_seconds", {"pilots, CPU s", "{:.1f}"}, [](const R& r) {
         return middle(r, [](const KnobChoice& c) {
           return c.tuning.ray_cpu_seconds + c.tuning.shade_cpu_seconds;
         });
       }}};
  return columns;
}

/// A point for each choice: the error measured over the error asked.
Chart chart_of(const std::vector<KnobRow>& rows) {
  ChartPanel panel{.title = "Error measured over error asked",
                   .x_label = "cost of a receiver, \u00b5s of CPU",
                   .y_label = "measured / asked",
                   .log_y = false};
  for (const KnobRow& row : rows) {
    ChartSeries series{.name =
                           fmt::format("{}, {}, {:.3g} %", row.scene, row.set, 100 * row.asked)};
    for (const KnobChoice& choice : row.choices)
      series.points.push_back({.x = choice.cost, .y = choice.error / row.asked});
    panel.series.push_back(std::move(series));
  }
  panel.limits.push_back({1, "asked"});
  return {.title = "Whether --error keeps its word", .panels = {panel}, .columns = 1};
}

Report report_of(const std::vector<KnobRow>& rows) {
  return {.name = "knob",
          .title = "Whether --error keeps its word",
          .reading = kKnobReading,
          .runs = 0,
          .tables = {tabulate<KnobRow>({.name = "rows"}, knob_columns(), rows)},
          .figures = {{.chart = chart_of(rows)}}};
}

}  // namespace

Experiment make_knob_experiment() {
  const auto options = std::make_shared<KnobOptions>();
  const auto scenes = std::make_shared<SceneList>(
      std::vector<std::string>{"fractal", "window", "city", "cornell", "box-lamp"});
  options->scene.points = 100'000;
  const auto declare = [=](Declaration& d) {
    d.scenes(*scenes);
    d.points(options->scene.points, "100k", 50'000);
    d.checked(options->checked, 1024);
    d.integer("--seeds", options->seeds, 1, 1000, "Choices of pilots for each error asked");
    d.quick("--seeds", options->seeds, 4);
    d.integer("--check-rays", options->rays, 16, 1 << 20, "Rays for each checked receiver");
    d.words("--set", options->sets,
            "Only these receivers: pixels of a picture, or points of the scene, in blocks or far "
            "apart; repeatable");
    d.for_experts("--set");
  };
  const auto run = [=](const Bench& b) {
    std::vector<KnobRow> rows;
    for (const SceneChoice& choice : scenes->choices()) {
      const std::vector<KnobRow> more = measure_knob(choice, *options, b.work, b.run, b.progress);
      rows.insert(rows.end(), more.begin(), more.end());
      b.publish(report_of(rows));
    }
    return report_of(rows);
  };
  return {.name = "knob",
          .purpose =
              "How often the error that --error asks for is not met, over many choices of pilots, "
              "and what is paid for it",
          .quick = "The first scene with 50k points, 1,024 receivers checked, 4 seeds",
          .declare = declare,
          .run = run,
          .check = [scenes] { scenes->check(); }};
}

}  // namespace ptc::bench
