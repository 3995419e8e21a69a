#include "tools/bench/chart/chart_drawing.h"

#include <algorithm>
#include <array>

namespace ptc {
namespace {

// Draws lines of text, `step` units apart.
void draw_lines(Canvas& canvas, const std::vector<std::string>& lines, Spot top_left, double step,
                const TextStyle& style) {
  double y = top_left.y + style.size;
  for (const std::string& line : lines) {
    canvas.text({top_left.x, y}, line, style);
    y += step;
  }
}

// Draws a sample and the name of each series.
void draw_legend(Canvas& canvas, const ChartLayout& layout,
                 const std::vector<SeriesStyle>& styles) {
  for (const LegendItem& item : layout.legend) {
    const SeriesStyle& style = styles[item.style];
    const Spot end{item.at.x + kLegendSample, item.at.y};
    canvas.line(std::array{item.at, end}, {kSeriesWidth, style.colour, style.dashed});
    canvas.marker({(item.at.x + end.x) / 2, item.at.y}, style.marker, style.colour);
    const TextStyle text = fitted(kLegendStyle, style.name,
                                  layout.width - layout.text_left - end.x - kLegendGap, canvas);
    canvas.text({end.x + kLegendGap, item.at.y + 0.35 * kLegendStyle.size}, style.name, text);
  }
}

}  // namespace

TextStyle fitted(TextStyle style, const std::string& text, double width, const Canvas& canvas) {
  const double needed = canvas.text_width(text, style);
  if (needed > width) style.size = std::max(1.0, style.size * width / needed);
  return style;
}

void draw_chart(Canvas& canvas, const Chart& chart, const ChartLayout& layout,
                const std::vector<SeriesStyle>& styles) {
  canvas.fill({0, 0, layout.width, layout.height}, {1, 1, 1});
  draw_lines(canvas, layout.title, {layout.text_left, layout.title_top}, kTitleLine, kTitleStyle);
  draw_legend(canvas, layout, styles);
  for (std::size_t i = 0; i < chart.panels.size(); ++i) {
    draw_panel(canvas, chart.panels[i], layout.panels[i], styles);
  }
  draw_lines(canvas, layout.note, {layout.text_left, layout.note_top}, kNoteLine, kNoteStyle);
}

}  // namespace ptc
