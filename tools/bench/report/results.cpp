#include "tools/bench/report/results.h"

#include <fmt/format.h>

#include "engine/io/file/text_file.h"

namespace ptc::bench {
namespace {

/// What a reader must know before quoting a number; empty where there is nothing of that kind.
std::string reservations(const Report& report, const Circumstances& c) {
  std::string text;
  if (report.runs > 0 && report.runs < kEnoughRuns) {
    text += fmt::format("**Fewer than {} runs ({})**: medians and ranges are uncertain.\n",
                        kEnoughRuns, report.runs);
  }
  if (c.changed) text += "**Built from a tree with changes that were not committed.**\n";
  return text.empty() ? text : text + "\n";
}

/// The table of machine, system, commit, date, command and runs.
std::string head_of(const Report& report, const Circumstances& c) {
  constexpr double kGibi = 1 << 30;
  const auto row = [](const char* what, const std::string& fact) {
    return fmt::format("| {} | {} |\n", what, fact);
  };
  return "| | |\n|---|---|\n" +
         row("machine",
             fmt::format("{}, {} core{}, {:.0f} GiB", c.processor, c.cores, c.cores == 1 ? "" : "s",
                         static_cast<double>(c.memory_bytes) / kGibi)) +
         row("instructions", c.instructions) + row("system", c.system) +
         row("load before", fmt::format("{:.2f} running threads", c.load)) +
         row("commit", c.commit + (c.changed ? " with changes" : "")) +
         row("date", c.date + " UTC") + row("command", "`" + c.command + "`") +
         row("runs",
             report.runs > 0 ? std::to_string(report.runs) : "1, of counts that do not vary");
}

/// Each chart as a picture in SVG that links to the PNG, then the pictures.
std::string links_of(const Report& report) {
  std::string text;
  for (const Figure& figure : report.figures) {
    if (figure.chart.panels.empty()) continue;
    const std::string file = file_name(report, figure.part);
    text += fmt::format("\n[![{}]({}.svg)]({}.png)\n", figure.chart.title, file, file);
  }
  for (const Sheet& sheet : report.sheets) {
    text += fmt::format("\n{}\n\n![{}]({}.png)\n", sheet.caption, sheet.caption,
                        file_name(report, sheet.part));
  }
  return text;
}

}  // namespace

std::string results_text(const Report& report, const Circumstances& circumstances) {
  std::string text = "# " + report.title + "\n\n" + report.reading + "\n\n" +
                     reservations(report, circumstances) + head_of(report, circumstances);
  for (const Table& table : report.tables) {
    const std::string words = markdown_of(table);
    if (!words.empty()) text += "\n" + words;
  }
  for (const std::string& note : report.notes) text += "\n" + note + "\n";
  return text + links_of(report);
}

void write_results(const std::filesystem::path& directory, const Report& report,
                   const Circumstances& circumstances) {
  write_figures(directory, report);
  write_text(directory / (report.name + ".md"), results_text(report, circumstances));
}

}  // namespace ptc::bench
