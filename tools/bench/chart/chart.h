// Charts: panels of points joined by lines, with one legend for all panels.
//
//   Title
//   -o- series   -[]- series                       legend
//   Panel title            Panel title
//   ^      label           ^
//   |     o                |- - - - - limit
//   |  o-'  |-o-|          |   o--o
//   +---------->           +---------->
//        x label                x label
//   Note, in small type
#pragma once

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace ptc {

/// A measured point. A point whose x or y cannot be shown (NaN, infinite, not above 0 on a log
/// axis) is left out, and the line is broken there.
struct ChartPoint {
  double x = 0;
  double y = 0;
  /// Minimum and maximum of x over the runs, drawn as a thin bar; NaN or x where there is no bar.
  double x_low = std::numeric_limits<double>::quiet_NaN();
  double x_high = std::numeric_limits<double>::quiet_NaN();
  std::string label;  ///< next to the point; left out where there is no room for it
};

/// Points joined by a line in their order. Series of equal names have equal colours and markers in
/// all panels.
struct ChartSeries {
  std::string name;
  std::vector<ChartPoint> points;
  bool dashed = false;
};

/// One pair of axes with its series.
struct ChartPanel {
  /// A horizontal dashed line, such as a limit that the series are compared with.
  struct Line {
    double y = 0;
    std::string label;
  };
  std::string title;
  std::string x_label;  ///< quantity and unit
  std::string y_label;  ///< quantity and unit
  bool log_x = true;
  bool log_y = true;
  std::vector<ChartSeries> series;
  std::vector<Line> limits;
};

/// A title, panels and a note.
struct Chart {
  std::string title;
  std::string note;  ///< small type under the panels, wrapped; line breaks are kept
  std::vector<ChartPanel> panels;
  unsigned columns = 3;  ///< panels in a row, at most
};

/// Draws a chart as SVG or PNG, by the ending of the target's name. Equal charts, fonts and
/// versions of cairo give equal bytes. The file is published whole or not at all.
///
/// A PNG has two pixels for each unit of the SVG. The SVG's text is drawn as outlines; its <title>
/// and <desc> hold what can be searched: titles, axes, names of series and the note.
/// @throws std::system_error; std::invalid_argument when the ending is another one, there is no
///         panel, columns is 0, a text is not UTF-8, or the chart is higher or wider than 16000
///         units
void write_chart(const std::filesystem::path& target, const Chart& chart);

}  // namespace ptc
