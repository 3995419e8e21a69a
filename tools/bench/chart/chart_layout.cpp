// From top to bottom: title, legend, rows of panels, note. The cell of one panel:
//
//   +-cell-----------------------------------+
//   |             Panel title                |  kPanelTitle
//   |            +-plot-------------------+  |
//   | y label 10 |                        |  |
//   |          1 |                        |  |
//   |            +------------------------+  |
//   |              1         10        100   |
//   |                   x label              |  kBelowPlot
//   +----------------------------------------+
//    <-- left --> is equal for all panels, so that the plots of a column line up
//
// Ticks are made coarser until their labels keep their distance.
#include "tools/bench/chart/chart_layout.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <sstream>

namespace ptc {
namespace {

constexpr double kMargin = 20;          // around the chart
constexpr double kLegendRow = 20;       // height of a row of the legend
constexpr double kLegendDistance = 22;  // between two items of the legend
constexpr double kPanelTitle = 27;      // above the plot
constexpr double kBelowPlot = 50;       // labels of ticks and of the axis
constexpr double kRightOfPlot = 22;
constexpr double kTickLabelGap = 5;    // minimum distance of two labels next to each other
constexpr double kTickLabelLine = 15;  // minimum distance of two labels one above the other
constexpr double kAxisName = 24;       // width of the y axis' label, left of the tick labels
constexpr double kTickLength = 7;      // from the axis to the tick labels

// The size of panels, which are larger where there are fewer columns.
struct CellSize {
  double width, plot_height;
};

CellSize cell_size(std::size_t columns) {
  if (columns == 1) return {600, 330};
  if (columns == 2) return {440, 250};
  return {345, 205};
}

// All values that the x axis of a panel has to show.
std::vector<double> x_values(const ChartPanel& panel) {
  std::vector<double> values;
  for (const ChartSeries& series : panel.series) {
    for (const ChartPoint& point : series.points) {
      if (can_show(panel, point)) values.insert(values.end(), {point.x, point.x_low, point.x_high});
    }
  }
  return values;
}

// All values that the y axis of a panel has to show, limits included.
std::vector<double> y_values(const ChartPanel& panel) {
  std::vector<double> values;
  for (const ChartSeries& series : panel.series) {
    for (const ChartPoint& point : series.points) {
      if (can_show(panel, point)) values.push_back(point.y);
    }
  }
  for (const ChartPanel::Line& limit : panel.limits) values.push_back(limit.y);
  return values;
}

// Chooses the y axis and the ticks whose labels fit above each other.
void set_y_axis(const ChartPanel& panel, double plot_height, PanelLayout& layout) {
  layout.y = axis_around(y_values(panel), panel.log_y);
  layout.y_ticks = ticks_that_fit(layout.y, [&](std::span<const double> ticks) {
    for (std::size_t i = 1; i < ticks.size(); ++i) {
      const double share = layout.y.share(ticks[i]) - layout.y.share(ticks[i - 1]);
      if (share * plot_height < kTickLabelLine) return false;
    }
    return true;
  });
}

// Chooses the x axis and the ticks whose labels fit next to each other.
void set_x_axis(const ChartPanel& panel, const Canvas& ruler, PanelLayout& layout) {
  layout.x = axis_around(x_values(panel), panel.log_x);
  layout.x_ticks = ticks_that_fit(layout.x, [&](std::span<const double> ticks) {
    double before = layout.plot.left - layout.plot.width();
    for (const double tick : ticks) {
      const double half = ruler.text_width(tick_label(tick), kTickStyle) / 2;
      const double x = layout.plot.left + layout.x.share(tick) * layout.plot.width();
      if (x - half < before + kTickLabelGap) return false;
      before = x + half;
    }
    return true;
  });
}

// The room left of the plots: one width for all panels, so that the plots line up.
double left_of_plots(const std::vector<PanelLayout>& panels, const Canvas& ruler) {
  double widest = 20;
  for (const PanelLayout& panel : panels) {
    for (const double tick : panel.y_ticks) {
      widest = std::max(widest, ruler.text_width(tick_label(tick), kTickStyle));
    }
  }
  return kAxisName + widest + kTickLength;
}

// Places the panels in rows. @return the height of all panels
double place_panels(const Chart& chart, double top, const Canvas& ruler, ChartLayout& layout) {
  // Choose the y axes first: the labels of their ticks decide where the plots begin
  const std::size_t columns = std::min<std::size_t>(chart.columns, chart.panels.size());
  const CellSize size = cell_size(columns);
  const double cell_height = kPanelTitle + size.plot_height + kBelowPlot;
  layout.panels.resize(chart.panels.size());
  for (std::size_t i = 0; i < chart.panels.size(); ++i) {
    set_y_axis(chart.panels[i], size.plot_height, layout.panels[i]);
  }
  // Place the cells, and choose the x axes
  const double left = left_of_plots(layout.panels, ruler);
  for (std::size_t i = 0; i < chart.panels.size(); ++i) {
    PanelLayout& panel = layout.panels[i];
    const double x = kMargin + static_cast<double>(i % columns) * size.width;
    const std::size_t row = i / columns;
    const double y = top + static_cast<double>(row) * cell_height;
    panel.cell = {x, y, x + size.width, y + cell_height};
    panel.plot = {x + left, y + kPanelTitle, x + size.width - kRightOfPlot,
                  y + kPanelTitle + size.plot_height};
    set_x_axis(chart.panels[i], ruler, panel);
    std::ranges::copy_if(
        chart.panels[i].limits, std::back_inserter(panel.limits),
        [&](const ChartPanel::Line& limit) { return can_show(limit.y, panel.y.log); });
    panel.empty = x_values(chart.panels[i]).empty();
  }
  return layout.panels.back().cell.bottom - top;
}

// Places the items of the legend in rows. @return the height of all rows
double place_legend(const std::vector<SeriesStyle>& styles, double top, const Canvas& ruler,
                    ChartLayout& layout) {
  double x = kMargin;
  double y = top + kLegendRow / 2;
  for (std::size_t i = 0; i < styles.size(); ++i) {
    const double width =
        kLegendSample + kLegendGap + ruler.text_width(styles[i].name, kLegendStyle);
    if (x > kMargin && x + width > layout.width - kMargin) {
      x = kMargin;
      y += kLegendRow;
    }
    layout.legend.push_back({{x, y}, i});
    x += width + kLegendDistance;
  }
  return styles.empty() ? 0 : y + kLegendRow / 2 - top;
}

}  // namespace

Spot PanelLayout::spot(double x_value, double y_value) const noexcept {
  return {plot.left + x.share(x_value) * plot.width(),
          plot.bottom - y.share(y_value) * plot.height()};
}

bool can_show(const ChartPanel& panel, const ChartPoint& point) noexcept {
  return can_show(point.x, panel.log_x) && can_show(point.y, panel.log_y);
}

std::vector<SeriesStyle> styles_of(const Chart& chart) {
  // Leave out yellow, which is too pale for a line on white
  constexpr std::array<Colour, 7> kColours = {{{0, 0.447, 0.698},      // blue
                                               {0.835, 0.369, 0},      // vermilion
                                               {0, 0.620, 0.451},      // bluish green
                                               {0.902, 0.624, 0},      // orange
                                               {0.8, 0.475, 0.655},    // reddish purple
                                               {0.337, 0.706, 0.914},  // sky blue
                                               {0.2, 0.2, 0.2}}};      // black
  constexpr std::array kMarkers = {Marker::circle,  Marker::square,   Marker::triangle,
                                   Marker::diamond, Marker::inverted, Marker::pentagon};
  std::vector<SeriesStyle> styles;
  for (const ChartPanel& panel : chart.panels) {
    for (const ChartSeries& series : panel.series) {
      if (std::ranges::find(styles, series.name, &SeriesStyle::name) != styles.end()) continue;
      const std::size_t i = styles.size();
      styles.push_back({series.name, kColours[i % kColours.size()], kMarkers[i % kMarkers.size()],
                        series.dashed});
    }
  }
  return styles;
}

std::vector<std::string> wrapped(const std::string& text, const TextStyle& style, double width,
                                 const Canvas& ruler) {
  std::vector<std::string> lines;
  std::istringstream paragraphs(text);
  for (std::string paragraph; std::getline(paragraphs, paragraph);) {
    std::istringstream words(paragraph);
    std::string line;
    for (std::string word; words >> word;) {
      std::string longer = line;
      if (!line.empty()) longer.push_back(' ');
      longer.append(word);
      if (!line.empty() && ruler.text_width(longer, style) > width) {
        lines.push_back(line);
        longer = word;
      }
      line = longer;
    }
    lines.push_back(line);
  }
  return lines;
}

ChartLayout lay_out(const Chart& chart, const std::vector<SeriesStyle>& styles,
                    const Canvas& ruler) {
  const std::size_t columns = std::min<std::size_t>(chart.columns, chart.panels.size());
  ChartLayout layout;
  layout.width = 2 * kMargin + static_cast<double>(columns) * cell_size(columns).width;
  layout.text_left = kMargin;
  const double text_width = layout.width - 2 * kMargin;
  double y = kMargin;
  layout.title_top = y;
  layout.title = wrapped(chart.title, kTitleStyle, text_width, ruler);
  if (!layout.title.empty()) y += static_cast<double>(layout.title.size()) * kTitleLine + 6;
  y += place_legend(styles, y, ruler, layout) + 10;
  y += place_panels(chart, y, ruler, layout);
  layout.note_top = y + 6;
  layout.note = wrapped(chart.note, kNoteStyle, text_width, ruler);
  if (!layout.note.empty()) y += 6 + static_cast<double>(layout.note.size()) * kNoteLine;
  layout.height = y + kMargin * 0.75;
  return layout;
}

}  // namespace ptc
