// Draws a chart whose layout is known.
#pragma once

#include <vector>

#include "tools/bench/chart/canvas.h"
#include "tools/bench/chart/chart.h"
#include "tools/bench/chart/chart_layout.h"

namespace ptc {

/// Draws the whole chart on white.
void draw_chart(Canvas& canvas, const Chart& chart, const ChartLayout& layout,
                const std::vector<SeriesStyle>& styles);

/// Draws one panel with its axes; it says "no data" where no point can be shown.
void draw_panel(Canvas& canvas, const ChartPanel& panel, const PanelLayout& layout,
                const std::vector<SeriesStyle>& styles);

/// Returns `style`, with a smaller font where the text would be wider than `width`.
[[nodiscard]] TextStyle fitted(TextStyle style, const std::string& text, double width,
                               const Canvas& canvas);

}  // namespace ptc
