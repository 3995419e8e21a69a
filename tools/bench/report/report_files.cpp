#include "tools/bench/report/report_files.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "engine/io/file/file.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

void write_text(const std::filesystem::path& path, const std::string& text) {
  OutputFile file(path);
  file.append(std::as_bytes(std::span(text)));
  file.publish();
}

/// A cell of a CSV file (RFC 4180): nothing for null, words in quotes.
std::string cell_of(const Json& value) {
  if (value.is_null()) return {};
  if (!value.is_string()) return value.dump();
  std::string cell = "\"";
  for (const char c : value.get_ref<const std::string&>())
    cell += c == '"' ? std::string("\"\"") : std::string(1, c);
  return cell + '"';
}

/// The rows' members as columns; all rows have the same.
std::string csv_of(const Json& rows) {
  std::string text;
  for (const auto& [key, value] : rows.front().items()) text += (text.empty() ? "" : ",") + key;
  for (const Json& row : rows) {
    std::string separator = "\n";
    for (const auto& [key, value] : row.items())
      text += std::exchange(separator, ",") + cell_of(value);
  }
  return text + "\n";
}

std::filesystem::path with_ending(const std::filesystem::path& name, const char* ending) {
  return name.string() + ending;
}

}  // namespace

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

nlohmann::ordered_json time_facts(const Spread& wall, const Spread& cpu, std::uint64_t points) {
  const double ns = 1e9 / static_cast<double>(std::max<std::uint64_t>(1, points));
  return {{"wall_seconds", wall.median}, {"wall_low", wall.low},
          {"wall_high", wall.high},      {"cpu_ns_per_point", ns * cpu.median},
          {"cpu_low", ns * cpu.low},     {"cpu_high", ns * cpu.high}};
}

std::string or_dash(double value, const char* format) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "-";
}

ChartSeries& series_of(ChartPanel& panel, const std::string& name, bool dashed) {
  const auto found = std::ranges::find(panel.series, name, &ChartSeries::name);
  if (found != panel.series.end()) return *found;
  return panel.series.emplace_back(ChartSeries{.name = name, .dashed = dashed});
}

void write_tables(const std::filesystem::path& name, const Json& facts) {
  write_text(with_ending(name, ".json"), facts.dump(2) + "\n");
  write_text(with_ending(name, ".csv"), csv_of(facts.at("rows")));
}

void write_figures(const std::filesystem::path& name, const Chart& chart) {
  for (const char* ending : {".svg", ".png"}) write_chart(with_ending(name, ending), chart);
}

}  // namespace ptc::bench
