#include "tools/bench/experiments/growth_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kTime[] = "CPU time per receiver, \u00b5s";
constexpr char kReading[] =
    "Receivers: the scene's own points in blocks of neighbours, spread evenly. Markers: median of "
    "all runs; beside them the RMS "
    "error of irradiance against rays at the same discs, over its mean, or the cache's hit rate; "
    "no label: not checked against "
    "rays. Embree: its time at the error of PTCX, with single rays or packets, whichever is "
    "faster. A cap is the share of all pages, "
    "decoded, that the page cache has frames for; it is empty when a run begins, and the files are "
    "in the system's cache.\n";

struct PanelKind {
  const char* panel;
  const char* title;
  const char* x_label;
  const char* y_label;
};

constexpr std::array kKinds{
    PanelKind{"surfels", "Surfels", "surfels of the city", kTime},
    PanelKind{"solid-angle", "Solid angle", "solid angle, sr", kTime},
    PanelKind{"depth", "Depth complexity", "sheets above the ground", kTime},
    PanelKind{"cap", "Memory", "page cache, % of all pages", kTime},
    PanelKind{"cap", "Memory, wall time", "page cache, % of all pages",
              "wall time per receiver, \u00b5s"},
    PanelKind{"cap", "Reading", "page cache, % of all pages", "bytes read per receiver"}};

std::string percent(double share, int digits) {
  return std::isfinite(share) ? fmt::format("{:.{}f} %", 100 * share, digits) : std::string();
}

using Value = std::function<double(const GrowthRow&)>;

ChartSeries series_of(const std::vector<GrowthRow>& rows, const PanelKind& kind,
                      const std::string& name, const Value& y,
                      const std::function<std::string(const GrowthRow&)>& label) {
  const bool caps = std::string_view(kind.panel) == "cap";
  ChartSeries series{.name = name};
  for (const GrowthRow& row : rows) {
    if (row.panel != kind.panel || !std::isfinite(y(row))) continue;
    series.points.push_back({.x = caps ? 100 * row.x : row.x, .y = y(row), .label = label(row)});
  }
  return series;
}

/// What the panel of caps shows.
double cap_value(const PanelKind& kind, const GrowthRow& row) {
  const std::string_view title = kind.title;
  return title == "Reading" ? row.bytes : title == "Memory" ? row.us.median : row.wall_us.median;
}

void add_caps(ChartPanel& panel, const std::vector<GrowthRow>& rows, const PanelKind& kind) {
  std::vector<unsigned> done;
  for (const GrowthRow& row : rows) {
    if (row.panel != kind.panel || std::ranges::find(done, row.threads) != done.end()) continue;
    done.push_back(row.threads);
    const auto y = [&](const GrowthRow& r) {
      return r.threads == row.threads ? cap_value(kind, r) : std::nan("");
    };
    panel.series.push_back(
        series_of(rows, kind, fmt::format("{} thread{}", row.threads, row.threads > 1 ? "s" : ""),
                  y, [](const GrowthRow& r) { return percent(r.hit_rate, 2); }));
  }
}

void add_times(ChartPanel& panel, const std::vector<GrowthRow>& rows, const PanelKind& kind) {
  const auto none = [](const GrowthRow&) { return std::string(); };
  panel.series.push_back(series_of(
      rows, kind, "PTCX", [](const GrowthRow& r) { return r.us.median; },
      [](const GrowthRow& r) { return percent(r.irradiance_rms, 1); }));
  panel.series.push_back(series_of(
      rows, kind, "Embree, same discs",
      [](const GrowthRow& r) { return r.us.median * r.speedup_discs; }, none));
  panel.series.push_back(series_of(
      rows, kind, "Embree, mesh", [](const GrowthRow& r) { return r.us.median * r.speedup_mesh; },
      none));
}

Json row_facts(const GrowthRow& row) {
  return {{"panel", row.panel},
          {"x", row.x},
          {"scene", row.scene},
          {"surfels", row.surfels},
          {"threads", row.threads},
          {"receivers", row.receivers},
          {"us_per_receiver", number(row.us.median)},
          {"us_low", number(row.us.low)},
          {"us_high", number(row.us.high)},
          {"wall_us_per_receiver", number(row.wall_us.median)},
          {"wall_us_low", number(row.wall_us.low)},
          {"wall_us_high", number(row.wall_us.high)},
          {"ao_rms", number(row.occlusion_rms)},
          {"e_rms", number(row.irradiance_rms)},
          {"speedup_discs", number(row.speedup_discs)},
          {"speedup_mesh", number(row.speedup_mesh)},
          {"hit_rate", number(row.hit_rate)},
          {"pages_per_receiver", number(row.pages)},
          {"bytes_per_receiver", number(row.bytes)}};
}

}  // namespace

Json facts_of(const std::vector<GrowthRow>& rows) {
  Json list = Json::array();
  for (const GrowthRow& row : rows) list.push_back(row_facts(row));
  return {{"rows", list}};
}

Chart chart_of(const std::vector<GrowthRow>& rows) {
  Chart chart{.title = "How the time of a receiver grows", .note = kReading, .columns = 3};
  for (const PanelKind& kind : kKinds) {
    ChartPanel panel{.title = kind.title, .x_label = kind.x_label, .y_label = kind.y_label};
    if (std::string_view(kind.panel) == "cap") {
      add_caps(panel, rows, kind);
    } else {
      add_times(panel, rows, kind);
    }
    std::erase_if(panel.series, [](const ChartSeries& s) { return s.points.empty(); });
    if (!panel.series.empty()) chart.panels.push_back(std::move(panel));
  }
  return chart;
}

void write_reports(const std::filesystem::path& directory, const std::vector<GrowthRow>& rows) {
  write_tables(directory / "growth", facts_of(rows));
  write_figures(directory / "growth", chart_of(rows));
}

std::string growth_text(const std::vector<GrowthRow>& rows) {
  std::string text = fmt::format(
      "{:<12} {:>10} {:>11} {:>3} {:>9} {:>19} {:>9} {:>7} {:>7} {:>8} {:>8} {:>8} {:>10}\n",
      "panel", "at", "surfels", "thr", "us", "[low, high]", "wall us", "AO %", "E %", "x discs",
      "x mesh", "hits %", "bytes");
  for (const GrowthRow& row : rows) {
    text += fmt::format(
        "{:<12} {:>10.5g} {:>11} {:>3} {:>9.1f} {:>19} {:>9} {:>7} {:>7} {:>8} {:>8} {:>8} "
        "{:>10}\n",
        row.panel, row.x, row.surfels, row.threads, row.us.median,
        fmt::format("[{:.1f}, {:.1f}]", row.us.low, row.us.high),
        or_dash(row.wall_us.median, "{:.1f}"), or_dash(100 * row.occlusion_rms, "{:.2f}"),
        or_dash(100 * row.irradiance_rms, "{:.2f}"), or_dash(row.speedup_discs, "{:.1f}"),
        or_dash(row.speedup_mesh, "{:.1f}"), or_dash(100 * row.hit_rate, "{:.3f}"),
        or_dash(row.bytes, "{:.1f}"));
  }
  return text;
}

}  // namespace ptc::bench
