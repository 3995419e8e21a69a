// Draws one panel from the bottom layer to the top: grid and axes, limits, bars and lines, markers,
// labels. Whatever is drawn is reported to the placer of labels, which comes last:
//
//   blocked (labels never cover it)           markers, bars, other labels
//   avoided (labels cover as little as can)   lines of series, limits
//
// The first series of a panel lies above the others.
#include <algorithm>
#include <array>

#include "tools/bench/chart/chart_drawing.h"
#include "tools/bench/chart/label_placer.h"

namespace ptc {
namespace {

constexpr Colour kGrid{0.91, 0.91, 0.91};
constexpr Colour kFrame{0.38, 0.38, 0.38};
constexpr Colour kLimit{0.45, 0.45, 0.45};
constexpr double kBarWidth = 1.1;
constexpr double kCap = 2.6;        // half the height of a bar's ends
constexpr double kTick = 4;         // length of a tick that has a label
constexpr double kLabelInset = 3;   // minimum distance of labels from the axes
constexpr double kMinorTick = 2.2;  // length of a tick without a label

void draw_grid(Canvas& canvas, const PanelLayout& layout) {
  const Box& plot = layout.plot;
  const Stroke grid{0.8, kGrid};
  for (const double tick : layout.x_ticks) {
    const double x = layout.spot(tick, layout.y.low).x;
    canvas.line(std::array{Spot{x, plot.top}, Spot{x, plot.bottom}}, grid);
  }
  for (const double tick : layout.y_ticks) {
    const double y = layout.spot(layout.x.low, tick).y;
    canvas.line(std::array{Spot{plot.left, y}, Spot{plot.right, y}}, grid);
  }
}

void draw_ticks(Canvas& canvas, const PanelLayout& layout) {
  const Box& plot = layout.plot;
  const Stroke stroke{0.8, kFrame};
  const auto along_x = [&](double value, double length) {
    const double x = layout.spot(value, layout.y.low).x;
    canvas.line(std::array{Spot{x, plot.bottom}, Spot{x, plot.bottom + length}}, stroke);
  };
  const auto along_y = [&](double value, double length) {
    const double y = layout.spot(layout.x.low, value).y;
    canvas.line(std::array{Spot{plot.left - length, y}, Spot{plot.left, y}}, stroke);
  };
  for (const double tick : minor_ticks(layout.x)) along_x(tick, kMinorTick);
  for (const double tick : minor_ticks(layout.y)) along_y(tick, kMinorTick);
  TextStyle style = kTickStyle;
  style.align = Align::centre;
  for (const double tick : layout.x_ticks) {
    along_x(tick, kTick);
    canvas.text({layout.spot(tick, layout.y.low).x, plot.bottom + 16}, tick_label(tick), style);
  }
  style.align = Align::right;
  for (const double tick : layout.y_ticks) {
    along_y(tick, kTick);
    const Spot at{plot.left - 7, layout.spot(layout.x.low, tick).y + 0.36 * style.size};
    canvas.text(at, tick_label(tick), style);
  }
}

// Draws the two axes, their labels and the panel's title.
void draw_frame(Canvas& canvas, const ChartPanel& panel, const PanelLayout& layout) {
  const Box& plot = layout.plot;
  canvas.line(std::array{Spot{plot.left, plot.top}, Spot{plot.left, plot.bottom},
                         Spot{plot.right, plot.bottom}},
              {0.9, kFrame});
  const TextStyle title =
      fitted(kPanelTitleStyle, panel.title, layout.cell.right - plot.left - 6, canvas);
  canvas.text({plot.left, plot.top - 9}, panel.title, title);
  const Spot middle{(plot.left + plot.right) / 2, (plot.top + plot.bottom) / 2};
  canvas.text({middle.x, plot.bottom + 34}, panel.x_label,
              fitted(kAxisStyle, panel.x_label, plot.width(), canvas));
  canvas.text_upwards({layout.cell.left + 12, middle.y}, panel.y_label,
                      fitted(kAxisStyle, panel.y_label, plot.height() + 20, canvas));
}

// A piece of a series' line: points that can be shown, up to the next one that cannot.
struct Part {
  std::vector<Spot> spots;
  std::vector<const ChartPoint*> points;
};

std::vector<Part> parts_of(const ChartPanel& panel, const PanelLayout& layout,
                           const ChartSeries& series) {
  std::vector<Part> parts(1);
  for (const ChartPoint& point : series.points) {
    if (!can_show(panel, point)) {
      parts.emplace_back();
      continue;
    }
    parts.back().spots.push_back(layout.spot(point.x, point.y));
    parts.back().points.push_back(&point);
  }
  return parts;
}

// The end of a bar. Where the value cannot be shown the bar ends at the point itself, or at the low
// end of a log axis for values not above 0.
double bar_end(double value, double x, const Axis& axis) {
  if (can_show(value, axis.log)) return value;
  return axis.log && value <= 0 ? axis.low : x;
}

// Draws the bar from the fastest to the slowest run.
void draw_bar(Canvas& canvas, const PanelLayout& layout, const ChartPoint& point,
              const Colour& colour, LabelPlacer& placer) {
  const Spot low = layout.spot(bar_end(point.x_low, point.x, layout.x), point.y);
  const Spot high = layout.spot(bar_end(point.x_high, point.x, layout.x), point.y);
  if (!(high.x > low.x)) return;
  placer.block({low.x, low.y - kCap, high.x, low.y + kCap});
  const Stroke stroke{kBarWidth, colour};
  canvas.line(std::array{low, high}, stroke);
  for (const Spot end : {low, high}) {
    canvas.line(std::array{Spot{end.x, end.y - kCap}, Spot{end.x, end.y + kCap}}, stroke);
  }
}

void draw_limits(Canvas& canvas, const PanelLayout& layout, LabelPlacer& placer) {
  const Box& plot = layout.plot;
  for (const ChartPanel::Line& limit : layout.limits) {
    const double y = layout.spot(layout.x.low, limit.y).y;
    canvas.line(std::array{Spot{plot.left, y}, Spot{plot.right, y}}, {1.1, kLimit, true});
    placer.avoid({plot.left, y}, {plot.right, y});
  }
}

// Draws a label on a translucent background that sets it off the lines under it.
void draw_label(Canvas& canvas, const Box& box, const std::string& label, const TextStyle& style) {
  canvas.fill(box, {1, 1, 1}, 0.7);
  canvas.text({box.left, box.bottom - 0.14 * style.size}, label, style);
}

// Draws the labels of limits above or below one end of their lines.
void draw_limit_labels(Canvas& canvas, const PanelLayout& layout, LabelPlacer& placer) {
  const Box& plot = layout.plot;
  for (const ChartPanel::Line& limit : layout.limits) {
    if (limit.label.empty()) continue;
    const TextStyle style = fitted({.size = kTickStyle.size, .colour = kPaleInk}, limit.label,
                                   plot.width() / 2, canvas);
    const double width = canvas.text_width(limit.label, style);
    const double y = layout.spot(layout.x.low, limit.y).y;
    const auto box_at = [&](double left, double top) {
      return Box{left, top, left + width, top + style.size};
    };
    const double right = plot.right - width - 3;
    const double left = plot.left + 4;
    const double over = y - style.size - 1.5;
    const double under = y + 1.5;
    const std::array boxes = {box_at(right, over), box_at(right, under), box_at(left, over),
                              box_at(left, under)};
    if (const auto box = placer.place(boxes)) draw_label(canvas, *box, limit.label, style);
  }
}

void draw_labels(Canvas& canvas, const Part& part, const Colour& colour, LabelPlacer& placer) {
  // Thin type looks paler than a line, so its colour is darker.
  const Colour ink{0.6 * colour.red, 0.6 * colour.green, 0.6 * colour.blue};
  const TextStyle style{.size = kTickStyle.size, .colour = ink};
  for (std::size_t i = 0; i < part.spots.size(); ++i) {
    const std::string& label = part.points[i]->label;
    if (label.empty()) continue;
    const double width = canvas.text_width(label, style);
    const auto boxes = boxes_around(part.spots[i], kMarkerRadius + 2, width, style.size);
    if (const auto box = placer.place(boxes)) draw_label(canvas, *box, label, style);
  }
}

void draw_no_data(Canvas& canvas, const Box& plot) {
  const Spot middle{(plot.left + plot.right) / 2, (plot.top + plot.bottom) / 2};
  canvas.text(middle, "no data", {.size = 12, .colour = kPaleInk, .align = Align::centre});
}

// A series with the positions of its points in the panel.
struct PlacedSeries {
  const SeriesStyle& style;
  bool dashed;
  std::vector<Part> parts;
};

std::vector<PlacedSeries> placed(const ChartPanel& panel, const PanelLayout& layout,
                                 const std::vector<SeriesStyle>& styles) {
  std::vector<PlacedSeries> all;
  for (const ChartSeries& series : panel.series) {
    all.push_back({*std::ranges::find(styles, series.name, &SeriesStyle::name), series.dashed,
                   parts_of(panel, layout, series)});
  }
  return all;
}

void draw_lines(Canvas& canvas, const PanelLayout& layout, const PlacedSeries& series,
                LabelPlacer& placer) {
  const Colour& colour = series.style.colour;
  for (const Part& part : series.parts) {
    for (const ChartPoint* point : part.points) draw_bar(canvas, layout, *point, colour, placer);
    canvas.line(part.spots, {kSeriesWidth, colour, series.dashed});
    for (std::size_t i = 1; i < part.spots.size(); ++i) {
      placer.avoid(part.spots[i - 1], part.spots[i]);
    }
  }
}

void draw_markers(Canvas& canvas, const PlacedSeries& series, LabelPlacer& placer) {
  constexpr double kReach = 0.8 * kMarkerRadius;
  for (const Part& part : series.parts) {
    for (const Spot& spot : part.spots) {
      canvas.marker(spot, series.style.marker, series.style.colour);
      placer.block({spot.x - kReach, spot.y - kReach, spot.x + kReach, spot.y + kReach});
    }
  }
}

}  // namespace

void draw_panel(Canvas& canvas, const ChartPanel& panel, const PanelLayout& layout,
                const std::vector<SeriesStyle>& styles) {
  // Say so where there is nothing to show
  if (layout.empty) {
    draw_frame(canvas, panel, layout);
    draw_no_data(canvas, layout.plot);
    return;
  }
  // Draw grid and axes
  draw_grid(canvas, layout);
  draw_ticks(canvas, layout);
  draw_frame(canvas, panel, layout);
  const Box& plot = layout.plot;
  LabelPlacer placer({plot.left + kLabelInset, plot.top, plot.right, plot.bottom - kLabelInset});
  // Draw lines under all markers, and labels over everything; the first series lies above the
  // others
  const std::vector<PlacedSeries> series = placed(panel, layout, styles);
  canvas.clip(plot);
  draw_limits(canvas, layout, placer);
  for (auto one = series.rbegin(); one != series.rend(); ++one) {
    draw_lines(canvas, layout, *one, placer);
  }
  canvas.unclip();
  for (auto one = series.rbegin(); one != series.rend(); ++one) draw_markers(canvas, *one, placer);
  draw_limit_labels(canvas, layout, placer);
  for (const PlacedSeries& one : series) {
    for (const Part& part : one.parts) draw_labels(canvas, part, one.style.colour, placer);
  }
}

}  // namespace ptc
