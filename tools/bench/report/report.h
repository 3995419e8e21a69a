// What an experiment found: tables, charts, and the words that say how to read them. One report
// gives all files of an experiment:
//
//   Report -> NAME.json, NAME.csv, NAME-TABLE.csv    facts, for programs (write_files())
//          -> NAME-PART.svg, NAME-PART.png           charts (write_figures())
//          -> NAME-PART.png                          pictures (write_figures())
//          -> NAME.md                                everything, for people (write_results())
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "engine/io/image/image.h"
#include "tools/bench/chart/chart.h"
#include "tools/bench/report/table.h"

namespace ptc::bench {

/// A chart with the name of its files.
struct Figure {
  std::string part;  ///< PART of NAME-PART.svg; empty: NAME.svg
  Chart chart;
};

/// A picture that belongs to a report, written as it is.
struct Sheet {
  std::string part;     ///< PART of NAME-PART.png
  std::string caption;  ///< a sentence that says what it shows; a line
  Image image;          ///< linear RGB, white at 1
};

/// What one command of ptcbench gives.
struct Report {
  std::string name;                  ///< NAME of its files, without ending
  std::string title;                 ///< what was measured, a few words
  std::string reading;               ///< what is measured against what, and how to read it
  unsigned runs = 1;                 ///< runs of each measurement; 0: nothing was timed
  std::vector<Table> tables;         ///< one or more
  std::vector<std::string> notes{};  ///< sentences about these numbers, one paragraph each
  std::vector<Figure> figures{};
  std::vector<Sheet> sheets{};
};

/// Finds the series of this name in a panel, or adds it.
[[nodiscard]] ChartSeries& series_of(ChartPanel& panel, const std::string& name, bool dashed);

/// Adds a panel without its empty series; a panel without any points is left out.
void add_panel(Chart& chart, ChartPanel panel);

/// The name of a file without its ending: NAME-PART, or NAME where the part is empty.
[[nodiscard]] std::string file_name(const Report& report, const std::string& part);

/// Returns {"rows": [...], "TABLE": [...]}: json_of() of each table under the table's name.
[[nodiscard]] nlohmann::ordered_json facts_of(const Report& report);

/// All tables and notes as text for a terminal.
[[nodiscard]] std::string text_of(const Report& report);

/// Writes the charts as NAME-PART.svg and NAME-PART.png, and the pictures as NAME-PART.png; charts
/// without panels are left out.
/// @throws std::system_error, std::invalid_argument as write_chart()
void write_figures(const std::filesystem::path& directory, const Report& report);

/// Writes NAME.json, the first table as NAME.csv, each further table as NAME-TABLE.csv, and the
/// charts. @throws std::system_error, std::invalid_argument as write_chart()
void write_files(const std::filesystem::path& directory, const Report& report);

}  // namespace ptc::bench
