// What an experiment found: tables, charts, and the words that tell how to read them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tools/bench/chart/chart.h"
#include "tools/bench/report/table.h"

namespace ptc::bench {

struct Figure {
  std::string part;  ///< after the report's name and a dash in that of its files; may be empty
  Chart chart;
};

struct Report {
  std::string name;  ///< of its files, without ending
  std::string title;
  std::string reading;               ///< what is measured against what, and how to read it
  unsigned runs = 1;                 ///< of each measurement; 0: nothing was timed
  std::vector<Table> tables;         ///< one or more
  std::vector<std::string> notes{};  ///< a sentence or more each, about these figures
  std::vector<Figure> figures{};
};

/// The series of a panel that has this name, a new one if there is none.
[[nodiscard]] ChartSeries& series_of(ChartPanel& panel, const std::string& name, bool dashed);

/// Adds a panel that shows something.
void add_panel(Chart& chart, ChartPanel panel);

/// NAME-PART, or NAME where the part is empty: what files are called, without their ending.
[[nodiscard]] std::string file_name(const Report& report, const std::string& part);

/// Writes a whole file or none. @throws std::system_error
void write_text(const std::filesystem::path& path, const std::string& text);

/// {"rows": [...], "TABLE": [...]}: json_of() of each table by its name.
[[nodiscard]] nlohmann::ordered_json facts_of(const Report& report);

/// All tables and notes.
[[nodiscard]] std::string text_of(const Report& report);

/// Writes the charts as NAME-PART.svg and .png. @throws as write_chart()
void write_figures(const std::filesystem::path& directory, const Report& report);

/// Writes NAME.json, the first table as NAME.csv, each other as NAME-TABLE.csv, and the charts.
/// @throws std::system_error
void write_files(const std::filesystem::path& directory, const Report& report);

}  // namespace ptc::bench
