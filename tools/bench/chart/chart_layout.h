// Where everything of a chart goes, before anything is drawn.
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

/// How the series of one name look.
struct SeriesStyle {
  std::string name;
  Colour colour;
  Marker marker = Marker::circle;
  bool dashed = false;  ///< in the first panel that has it
};

/// One style a name, in the order in which names appear. Colours are those of Okabe and Ito 2008
/// that stand out from white; markers go through another number of shapes, so that 42 pairs differ.
[[nodiscard]] std::vector<SeriesStyle> styles_of(const Chart& chart);

struct LegendItem {
  Spot at;  ///< left end of the sample's line
  std::size_t style = 0;
};

struct PanelLayout {
  Box cell;  ///< with titles and names of values
  Box plot;  ///< inside the axes
  Axis x;
  Axis y;
  std::vector<double> x_ticks;
  std::vector<double> y_ticks;
  std::vector<ChartPanel::Line> limits;  ///< that the y axis can show
  bool empty = false;                    ///< no point can be shown

  [[nodiscard]] Spot spot(double x_value, double y_value) const noexcept;
};

struct ChartLayout {
  double width = 0;
  double height = 0;
  double text_left = 0;
  double title_top = 0;
  double note_top = 0;
  std::vector<std::string> title;  ///< lines
  std::vector<std::string> note;
  std::vector<LegendItem> legend;
  std::vector<PanelLayout> panels;
};

constexpr double kSeriesWidth = 1.7;  ///< of lines
constexpr double kTitleLine = 23;
constexpr double kNoteLine = 13.5;
constexpr double kLegendSample = 30;  ///< line of a legend's item
constexpr double kLegendGap = 7;      ///< from there to its name

/// @param ruler  measures the texts
[[nodiscard]] ChartLayout lay_out(const Chart& chart, const std::vector<SeriesStyle>& styles,
                                  const Canvas& ruler);

/// Whether a panel can show a point at all.
[[nodiscard]] bool can_show(const ChartPanel& panel, const ChartPoint& point) noexcept;

/// Lines no wider than `width` where blanks allow it; line breaks of the text are kept.
[[nodiscard]] std::vector<std::string> wrapped(const std::string& text, const TextStyle& style,
                                               double width, const Canvas& ruler);

}  // namespace ptc
