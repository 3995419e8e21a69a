// Facts, tables and charts of a report as files. Each file is published whole, so that a reader
// never sees half of one while the experiment goes on.
#include "tools/bench/report/report.h"

#include <algorithm>
#include <utility>

#include "engine/io/file/text_file.h"

namespace ptc::bench {

ChartSeries& series_of(ChartPanel& panel, const std::string& name, bool dashed) {
  const auto found = std::ranges::find(panel.series, name, &ChartSeries::name);
  if (found != panel.series.end()) return *found;
  return panel.series.emplace_back(ChartSeries{.name = name, .dashed = dashed});
}

void add_panel(Chart& chart, ChartPanel panel) {
  std::erase_if(panel.series, [](const ChartSeries& series) { return series.points.empty(); });
  if (!panel.series.empty()) chart.panels.push_back(std::move(panel));
}

std::string file_name(const Report& report, const std::string& part) {
  return part.empty() ? report.name : report.name + "-" + part;
}

nlohmann::ordered_json facts_of(const Report& report) {
  nlohmann::ordered_json facts;
  for (const Table& table : report.tables) facts[table.caption.name] = json_of(table);
  return facts;
}

std::string text_of(const Report& report) {
  std::string text;
  for (const Table& table : report.tables) {
    const std::string words = text_of(table);
    if (!words.empty()) text += (text.empty() ? "" : "\n") + words;
  }
  for (const std::string& note : report.notes) text += note + "\n";
  return text;
}

void write_figures(const std::filesystem::path& directory, const Report& report) {
  for (const Figure& figure : report.figures) {
    if (figure.chart.panels.empty()) continue;
    for (const char* ending : {".svg", ".png"})
      write_chart(directory / (file_name(report, figure.part) + ending), figure.chart);
  }
  for (const Sheet& sheet : report.sheets)
    write_png(directory / (file_name(report, sheet.part) + ".png"), sheet.image);
}

void write_files(const std::filesystem::path& directory, const Report& report) {
  write_text(directory / (report.name + ".json"), facts_of(report).dump(2) + "\n");
  for (const Table& table : report.tables) {
    if (table.rows.empty()) continue;
    const bool first = &table == &report.tables.front();  // its file has the report's name alone
    write_text(directory / (file_name(report, first ? "" : table.caption.name) + ".csv"),
               csv_of(table));
  }
  write_figures(directory, report);
}

}  // namespace ptc::bench
