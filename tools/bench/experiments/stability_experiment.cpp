// The experiment `ptcbench stability`: its table, its sheet of pictures and its options.
#include <algorithm>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "tools/bench/chart/flip.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/report/sheet.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

constexpr char kStabilityReading[] =
    "Small scenes in which this method, or others like it, fail, shaded with the default settings. "
    "Beside each stands an answer that shares no code with the gather: a formula, exact discs, or "
    "rays at the discs or at the mesh. 0 would be right everywhere. What is shown is light over pi "
    "(1 where white surrounds a receiver) or the share of the hemisphere that is open. Numbers of "
    "rows count the failures that spec/shading.md#stability lists. FLIP is the visible difference, "
    "from 0 to 1, mean over the small picture. Of pictures that follow one another a slice is "
    "shown, the row of pixels with the largest step of each frame below that of the frame before; "
    "steps are those of a pixel from frame to frame in any channel, where 0.5 % of white beyond "
    "1.5 of the true step is the aim. Temporal FLIP is FLIP (Andersson et al. 2020) between both "
    "changes, ours and the true one, half as large around grey. Bounds are those of the tests.";

/// A line of the table: a figure of a row.
struct Line {
  std::string number, scene, failure;
  Bounded figure;
  std::optional<double> flip;
};

const Columns<Line>& stability_columns() {
  using L = Line;
  const auto shown = [](double Bounded::*member) {
    return [member](const L& line) {
      const double value = line.figure.*member;
      return line.figure.share ? fmt::format("{:.3g} %", 100 * value)
                               : fmt::format("{:.3g}", value);
    };
  };
  static const Columns<L> columns{
      {"number", {"row"}, &L::number},
      {"scene", {"scene"}, &L::scene},
      {"failure", {"seen where a method fails"}, &L::failure},
      {"figure", {"figure"}, path(&L::figure, &Bounded::what)},
      {"value", {""}, path(&L::figure, &Bounded::value)},
      {"bound", {""}, path(&L::figure, &Bounded::bound)},
      {"shown_value", {"measured"}, shown(&Bounded::value)},
      {"shown_bound", {"bound"}, shown(&Bounded::bound)},
      {"holds",
       {"holds"},
       [](const L& line) { return std::string(line.figure.holds() ? "yes" : "NO"); }},
      {"flip", {"FLIP", "{:.4f}"}, [](const L& line) {
         return line.flip ? Value(*line.flip) : Value();
       }}};
  return columns;
}

/// Returns a field beside the truth and their visible difference. @param error  receives its mean
Image panel_of(const Field& field, double& error) {
  const Image ours{field.width, field.height, field.ours};
  const Image truth{field.width, field.height, field.truth};
  const std::vector<float> errors = flip(ours, truth);
  error = mean_of(errors);
  return side_by_side({ours, truth, flip_map(errors, field.width, field.height)});
}

Report report_of(const std::vector<Line>& lines, const std::vector<Image>& panels) {
  Report report{.name = "stability",
                .title = "Where the method fails",
                .reading = kStabilityReading,
                .runs = 0,
                .tables = {}};
  report.tables.push_back(tabulate<Line>({.name = "rows"}, stability_columns(), lines));
  report.sheets.push_back(
      {.part = "sheet",
       .caption =
           "Each row's receivers, from the first row of the table down and then to the right: "
           "PTCX, the truth, and FLIP from 0 (black) over red and yellow to 0.25 and more "
           "(white).",
       .image = in_columns(panels, 4, 2)});
  return report;
}

}  // namespace

Experiment make_stability_experiment() {
  const auto numbers = std::make_shared<std::vector<std::string>>();
  const auto check = [=] {
    for (const std::string& number : *numbers) {
      const std::vector<Row> rows = all_rows();
      require_request(
          std::ranges::any_of(rows, [&](const Row& row) { return number == row.number; }), "row",
          "no row has this number");
    }
  };
  const auto run = [=](const Bench& b) {
    const ThreadPool executor(b.run.threads);
    const Lab lab{b.work, executor};
    std::vector<Line> lines;
    std::vector<Image> panels;
    for (const Row& row : all_rows()) {
      if (!numbers->empty() && std::ranges::find(*numbers, row.number) == numbers->end()) continue;
      const Outcome outcome = row.measure(lab);
      std::optional<double> flip;
      if (!outcome.field.ours.empty()) panels.push_back(panel_of(outcome.field, flip.emplace()));
      for (const Bounded& figure : outcome.figures) {
        lines.push_back({row.number, row.scene, row.failure, figure, flip});
      }
      b.publish(report_of(lines, panels));
    }
    return report_of(lines, panels);
  };
  return {.name = "stability",
          .purpose =
              "Figures and pictures of scenes in which the method fails, beside the truth, "
              "with the bounds that tests hold",
          .quick = "Nothing else: all rows take a minute or two",
          .declare =
              [=](Declaration& d) {
                d.list(
                    "--row", "N", *numbers, [](const std::string& text) { return text; },
                    "Measure only the rows of this number, 1 to 33; repeatable");
              },
          .run = run,
          .check = check};
}

}  // namespace ptc::bench
