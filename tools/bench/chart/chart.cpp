// From a chart to a picture: choose styles, lay out, draw, write.
#include "tools/bench/chart/chart.h"

#include <cmath>
#include <stdexcept>

#include <cairo.h>

#include "tools/bench/chart/chart_drawing.h"
#include "tools/bench/chart/chart_layout.h"
#include "tools/bench/chart/picture.h"

namespace ptc {
namespace {

// Everything that a search may look for, one line each: in the SVG itself text is only outlines.
std::string description(const Chart& chart, const std::vector<SeriesStyle>& styles) {
  std::string text;
  for (const ChartPanel& panel : chart.panels) {
    text.append(panel.title + ": " + panel.y_label + " over " + panel.x_label + "\n");
  }
  for (const SeriesStyle& style : styles) text.append(style.name + "\n");
  text.append(chart.note);
  return text;
}

// The layout, with the text measured on an invisible surface.
ChartLayout measured_layout(const Chart& chart, const std::vector<SeriesStyle>& styles) {
  const Surface paper(cairo_image_surface_create(CAIRO_FORMAT_A8, 1, 1));
  const Canvas ruler(paper, 1);
  ChartLayout layout = lay_out(chart, styles, ruler);
  layout.width = std::ceil(layout.width);
  layout.height = std::ceil(layout.height);
  return layout;
}

}  // namespace

void write_chart(const std::filesystem::path& target, const Chart& chart) {
  if (chart.panels.empty() || chart.columns == 0) {
    throw std::invalid_argument("write_chart: a chart needs at least one panel and one column");
  }
  const std::vector<SeriesStyle> styles = styles_of(chart);
  const ChartLayout layout = measured_layout(chart, styles);
  write_picture(target,
                {.width = layout.width,
                 .height = layout.height,
                 .title = chart.title,
                 .description = description(chart, styles),
                 .draw = [&](Canvas& canvas) { draw_chart(canvas, chart, layout, styles); }});
}

}  // namespace ptc
