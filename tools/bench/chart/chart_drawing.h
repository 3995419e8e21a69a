// From a layout to shapes.
#pragma once

#include <vector>

#include "tools/bench/chart/canvas.h"
#include "tools/bench/chart/chart.h"
#include "tools/bench/chart/chart_layout.h"

namespace ptc {

/// The whole chart on white.
void draw_chart(Canvas& canvas, const Chart& chart, const ChartLayout& layout,
                const std::vector<SeriesStyle>& styles);

/// One panel with its axes; "no data" where no point can be shown.
void draw_panel(Canvas& canvas, const ChartPanel& panel, const PanelLayout& layout,
                const std::vector<SeriesStyle>& styles);

/// A text's style, smaller where the text would be wider than `width`.
[[nodiscard]] TextStyle fitted(TextStyle style, const std::string& text, double width,
                               const Canvas& canvas);

}  // namespace ptc
