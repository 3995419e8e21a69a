// Computes where every part of a chart goes, before anything is drawn. Lengths are units of the
// SVG.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tools/bench/chart/axis.h"
#include "tools/bench/chart/canvas.h"
#include "tools/bench/chart/chart.h"

namespace ptc {

constexpr Colour kInk{0.13, 0.13, 0.13};
constexpr Colour kPaleInk{0.38, 0.38, 0.38};

constexpr TextStyle kTitleStyle{.size = 17, .colour = kInk, .bold = true};
constexpr TextStyle kLegendStyle{.size = 11, .colour = kInk};
constexpr TextStyle kPanelTitleStyle{.size = 12.5, .colour = kInk, .bold = true};
constexpr TextStyle kAxisStyle{.size = 11, .colour = kInk, .align = Align::centre};
constexpr TextStyle kTickStyle{.size = 9.5, .colour = kPaleInk};
constexpr TextStyle kNoteStyle{.size = 9.5, .colour = kPaleInk};

/// The look of all series of one name.
struct SeriesStyle {
  std::string name;
  Colour colour;
  Marker marker = Marker::circle;
  bool dashed = false;  ///< the line's look in the first panel that has the series
};

/// Chooses a style for each name, in the order in which names appear. The seven colours are those
/// of Okabe and Ito 2008 that stand out from white; the six markers are taken in turn as well, so
/// that 42 pairs of colour and marker differ.
[[nodiscard]] std::vector<SeriesStyle> styles_of(const Chart& chart);

/// One name in the legend.
struct LegendItem {
  Spot at;                ///< left end of the sample's line
  std::size_t style = 0;  ///< index into the styles
};

/// Where the parts of one panel go.
struct PanelLayout {
  Box cell;  ///< the panel with its title and the labels of its axes
  Box plot;  ///< inside the axes
  Axis x;
  Axis y;
  std::vector<double> x_ticks;
  std::vector<double> y_ticks;
  std::vector<ChartPanel::Line> limits;  ///< lines that the y axis can show
  bool empty = false;                    ///< no point can be shown

  /// The position of a pair of values.
  [[nodiscard]] Spot spot(double x_value, double y_value) const noexcept;
};

/// Where the parts of a chart go.
struct ChartLayout {
  double width = 0;
  double height = 0;
  double text_left = 0;
  double title_top = 0;
  double note_top = 0;
  std::vector<std::string> title;  ///< lines of the title
  std::vector<std::string> note;   ///< lines of the note
  std::vector<LegendItem> legend;
  std::vector<PanelLayout> panels;
};

constexpr double kSeriesWidth = 1.7;  ///< width of the lines of series
constexpr double kTitleLine = 23;     ///< height of a line of the title
constexpr double kNoteLine = 13.5;    ///< height of a line of the note
constexpr double kLegendSample = 30;  ///< length of the line of an item of the legend
constexpr double kLegendGap = 7;      ///< gap between that line and the name

/// Lays out a chart of one or more panels.
/// @param ruler  measures the texts
[[nodiscard]] ChartLayout lay_out(const Chart& chart, const std::vector<SeriesStyle>& styles,
                                  const Canvas& ruler);

/// Whether the axes of a panel can show a point.
[[nodiscard]] bool can_show(const ChartPanel& panel, const ChartPoint& point) noexcept;

/// Breaks text into lines that are no wider than `width` where blanks allow it. Line breaks of the
/// text are kept.
[[nodiscard]] std::vector<std::string> wrapped(const std::string& text, const TextStyle& style,
                                               double width, const Canvas& ruler);

}  // namespace ptc
