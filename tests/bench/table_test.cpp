// Columns: one list gives JSON, CSV, text and Markdown with the same content.
#include "tools/bench/report/table.h"

#include <set>
#include <sstream>

#include <catch2/catch.hpp>

#include "tools/bench/chart/statistics.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

struct Run {
  std::string scene;
  std::uint64_t points = 0;
  Spread wall;
  double error = 0;
  bool sound = true;
};

const Columns<Run>& columns() {
  static const Columns<Run> list{
      {"scene", {"scene"}, &Run::scene},
      {"points", {"points"}, &Run::points},
      {"wall_seconds", {"wall ms", "{:.1f}", 0.001}, &Run::wall},
      {"error", {"RMS %", "{:.2f}", kPercent}, &Run::error},
      {"sound", {"sound"}, &Run::sound},
      {"shift", {}, [](const Run& run) { return when(run.points > 1000, 3U); }}};
  return list;
}

/// Two complete rows, and one row with nothing but a name.
std::vector<Run> runs() {
  return {{"city", 1'234'567, {0.25, 0.2, 0.5}, 0.0125},
          {"a | b, \"c\"", 999, {2, 2, 2}, 1, false},
          {"none", 0, kNoSpread, kNone}};
}

Table table_of(const std::vector<Run>& rows, const std::string& group = "") {
  return tabulate<Run>({.name = "rows", .title = "Runs", .group = group}, columns(), rows);
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// Returns the cells of a line of Markdown.
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  for (std::size_t i = 2; i + 2 < line.size(); ++i) {
    if (line.substr(i, 3) == " | ") {
      cells.emplace_back();
      i += 2;
    } else {
      cells.back() += line[i];
    }
  }
  return cells;
}

}  // namespace

TEST_CASE("table: JSON has every column, and repeated runs as three members", "[bench][table]") {
  const nlohmann::ordered_json rows = json_of(table_of(runs()));
  REQUIRE(rows.size() == 3);
  CHECK(rows[0].dump() ==
        R"({"scene":"city","points":1234567,"wall_seconds":0.25,"wall_seconds_low":0.2,)"
        R"("wall_seconds_high":0.5,"error":0.0125,"sound":true,"shift":3})");
  for (const auto& row : rows) CHECK(row.size() == rows.front().size());
}

TEST_CASE("table: a value that is missing is null, an empty cell or a dash, and never 0",
          "[bench][table]") {
  const Table table = table_of(runs());
  const nlohmann::ordered_json row = json_of(table)[2];
  for (const char* key :
       {"wall_seconds", "wall_seconds_low", "wall_seconds_high", "error", "shift"})
    CHECK(row.at(key).is_null());
  CHECK(row.at("points") == 0);  // which was counted
  CHECK(lines_of(csv_of(table))[3] == "\"none\",0,,,,,true,");
  CHECK(lines_of(markdown_of(table)).back() == "| none | 0 | - | - | yes |");
  CHECK_THAT(lines_of(text_of(table)).back(), Catch::Matches("none +0 +- +- +yes"));
  const double infinite = std::numeric_limits<double>::infinity();
  CHECK(json_of(table_of({{"far", 1, {1, 1, 1}, infinite}}))[0].at("error").is_null());
}

TEST_CASE("table: CSV has the members of JSON, each in its cell", "[bench][table]") {
  const Table table = table_of(runs());
  const std::vector<std::string> lines = lines_of(csv_of(table));
  REQUIRE(lines.size() == 4);
  CHECK(lines[0] ==
        "scene,points,wall_seconds,wall_seconds_low,wall_seconds_high,error,sound,shift");
  CHECK(lines[1] == "\"city\",1234567,0.25,0.2,0.5,0.0125,true,3");
  CHECK(lines[2] == "\"a | b, \"\"c\"\"\",999,2.0,2.0,2.0,1.0,false,");
  CHECK(csv_of(table_of({})).empty());
}

TEST_CASE("table: Markdown shows units, the median with its range, and no hidden column",
          "[bench][table]") {
  const std::vector<std::string> lines = lines_of(markdown_of(table_of(runs())));
  REQUIRE(lines.size() == 7);
  CHECK(lines[0] == "### Runs");
  CHECK(lines[2] == "| scene | points | wall ms | RMS % | sound |");
  CHECK(lines[3] == "|---|---:|---:|---:|---:|");
  CHECK(lines[4] == "| city | 1,234,567 | 250.0 [200.0, 500.0] | 1.25 | yes |");
  CHECK(lines[5] == "| a \\| b, \"c\" | 999 | 2000.0 | 100.00 | no |");
}

TEST_CASE("table: text has the cells of Markdown, with words flush left and numbers flush right",
          "[bench][table]") {
  const Table table = table_of({runs()[0], runs()[2]});
  const std::vector<std::string> text = lines_of(text_of(table)),
                                 markdown = lines_of(markdown_of(table));
  REQUIRE(text.size() == 4);
  CHECK(text[0] == "Runs");
  CHECK(text[2] == "city   1,234,567  250.0 [200.0, 500.0]   1.25    yes");
  for (std::size_t line = 1; line < text.size(); ++line) {
    const std::size_t below = line == 1 ? 2 : line + 2;
    for (const std::string& cell : cells_of(markdown[below])) {
      CAPTURE(cell);
      CHECK(text[line].find(cell) != std::string::npos);
    }
  }
  CHECK(text[1].size() == text[2].size());
}

TEST_CASE("table: readers get one table for each group, without columns that say nothing",
          "[bench][table]") {
  std::vector<Run> rows = runs();
  rows.push_back(rows[0]);
  const std::string text = markdown_of(table_of(rows, "scene"));
  const std::vector<std::string> lines = lines_of(text);
  CHECK(lines[0] == "### Runs: city");
  CHECK(lines[2] == "| points | wall ms | RMS % | sound |");
  CHECK(lines[4] == lines[5]);  // both rows of the city
  CHECK_THAT(text, Catch::Contains("### Runs: none\n\n| points | sound |\n"));
  CHECK(json_of(table_of(rows, "scene")) == json_of(table_of(rows)));
}
