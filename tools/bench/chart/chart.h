// Charts as figures: panels of points joined by lines, one legend for all.
#pragma once

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace ptc {

/// A measurement. Where x or y cannot be shown (NaN, infinite, not above 0 on a log axis) the point
/// is left out and the line is broken.
struct ChartPoint {
  double x = 0;
  double y = 0;
  /// Least and greatest x of the runs, drawn as a thin bar; NaN or x when there is none.
  double x_low = std::numeric_limits<double>::quiet_NaN();
  double x_high = std::numeric_limits<double>::quiet_NaN();
  std::string label;  ///< beside the point; left out where there is no room for it
};

/// Points joined by a line in their order. Equal names have equal colours and markers in all
/// panels.
struct ChartSeries {
  std::string name;
  std::vector<ChartPoint> points;
  bool dashed = false;
};

struct ChartPanel {
  /// A horizontal dashed line.
  struct Line {
    double y = 0;
    std::string label;
  };
  std::string title;
  std::string x_label;
  std::string y_label;
  bool log_x = true;
  bool log_y = true;
  std::vector<ChartSeries> series;
  std::vector<Line> limits;
};

struct Chart {
  std::string title;
  std::string note;  ///< in small type under the panels, wrapped; line breaks are kept
  std::vector<ChartPanel> panels;
  unsigned columns = 3;
};

/// Draws a chart as SVG or PNG, by the ending of the target's name, in equal bytes for equal
/// charts, fonts and versions of cairo. Published whole or not at all.
///
/// A PNG has two pixels for each unit of the SVG. The SVG's text is drawn as outlines; its <title>
/// and <desc> hold what can be searched: titles, axes, names of series and the note.
/// @throws std::system_error; std::invalid_argument when the ending is another one, there is no
///         panel, columns is 0, a text is no UTF-8, or the chart is higher or wider than 16000
///         units
void write_chart(const std::filesystem::path& target, const Chart& chart);

}  // namespace ptc
