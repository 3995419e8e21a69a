// The places of everything in a chart, and the styles of series.
#include "tools/bench/chart/chart_layout.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <catch2/catch.hpp>

using namespace ptc;

namespace {

struct Ruler {
  Surface paper{cairo_image_surface_create(CAIRO_FORMAT_A8, 1, 1)};
  Canvas canvas{paper, 1};
};

ChartPanel panel_of(std::vector<ChartSeries> series) {
  return {"title", "x", "y", true, true, std::move(series), {}};
}

Chart chart_of(std::size_t panels, unsigned columns, std::size_t names = 3) {
  Chart chart{"A chart", "A note.", {}, columns};
  for (std::size_t i = 0; i < panels; ++i) {
    ChartPanel panel = panel_of({});
    for (std::size_t s = 0; s < names; ++s) {
      panel.series.push_back({"series " + std::to_string(s), {{1, 2}, {30, 4}, {900, 50}}});
    }
    chart.panels.push_back(panel);
  }
  return chart;
}

ChartLayout layout_of(const Chart& chart) {
  const Ruler ruler;
  return lay_out(chart, styles_of(chart), ruler.canvas);
}

bool inside(const Box& box, double width, double height) {
  return box.left >= 0 && box.top >= 0 && box.right <= width && box.bottom <= height &&
         box.width() > 100 && box.height() > 100;
}

bool overlap(const Box& a, const Box& b) {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}

}  // namespace

TEST_CASE("chart layout: panels lie in the chart and next to each other", "[chart]") {
  for (std::size_t panels = 1; panels <= 7; ++panels) {
    for (unsigned columns = 1; columns <= 5; ++columns) {
      const ChartLayout layout = layout_of(chart_of(panels, columns));
      REQUIRE(layout.panels.size() == panels);
      std::set<double> rows;
      for (std::size_t i = 0; i < panels; ++i) {
        CHECK(inside(layout.panels[i].plot, layout.width, layout.note_top));
        rows.insert(layout.panels[i].plot.top);
        for (std::size_t j = 0; j < i; ++j) {
          CHECK_FALSE(overlap(layout.panels[i].cell, layout.panels[j].cell));
        }
      }
      CHECK(rows.size() == (panels + columns - 1) / columns);
    }
  }
}

TEST_CASE("chart layout: a legend of many names continues in the next row", "[chart]") {
  const ChartLayout few = layout_of(chart_of(3, 3, 3));
  const ChartLayout many = layout_of(chart_of(3, 3, 20));
  REQUIRE(many.legend.size() == 20);
  CHECK(many.height > few.height);
  for (const LegendItem& item : many.legend) {
    CHECK(item.at.x < many.width - 80);
    CHECK(item.at.y < many.panels[0].cell.top);
  }
}

TEST_CASE("chart layout: values lie between the axes, and their labels do not overlap", "[chart]") {
  const Ruler ruler;
  Chart chart = chart_of(6, 3);
  for (std::size_t i = 0; i < 6; ++i) {  // up to 900, 9k, 90k ...
    chart.panels[i].series[0].points[2].x *= std::pow(10.0, i);
  }
  const ChartLayout layout = layout_of(chart);
  for (const PanelLayout& panel : layout.panels) {
    const Spot low = panel.spot(1, 2);
    const Spot high = panel.spot(900, 50);
    CHECK(low.x > panel.plot.left);
    CHECK(high.x < panel.plot.right);
    CHECK(low.y < panel.plot.bottom);
    CHECK(high.y > panel.plot.top);
    CHECK(low.y > high.y);
    CHECK(panel.x_ticks.size() >= 4);
    double before = -100;
    for (const double tick : panel.x_ticks) {
      const double half = ruler.canvas.text_width(tick_label(tick), kTickStyle) / 2;
      CHECK(panel.spot(tick, 2).x - half > before + 3);
      before = panel.spot(tick, 2).x + half;
    }
  }
}

TEST_CASE("chart layout: bars and limits widen the axes", "[chart]") {
  Chart chart{"", "", {panel_of({{"a", {{10, 10, 2, 5000}, {20, 20}}}})}};
  chart.panels[0].limits = {{3000, "limit"}, {-1, "cannot be shown"}};
  const ChartLayout layout = layout_of(chart);
  CHECK(layout.panels[0].x.low < 2);
  CHECK(layout.panels[0].x.high > 5000);
  CHECK(layout.panels[0].y.low < 10);
  CHECK(layout.panels[0].y.high > 3000);
  REQUIRE(layout.panels[0].limits.size() == 1);
  CHECK(layout.panels[0].limits[0].y == 3000);
  CHECK_FALSE(layout.panels[0].empty);
}

TEST_CASE("chart layout: a panel is empty when no point has both values", "[chart]") {
  const std::vector<ChartSeries> bad = {{"a", {{NAN, 1}, {1, NAN}, {0, 1}, {1, -1}}}, {"b", {}}};
  Chart chart{"", "", {panel_of(bad), panel_of({}), panel_of(bad)}};
  chart.panels[2].log_x = false;  // shows (0, 1)
  const ChartLayout layout = layout_of(chart);
  CHECK(layout.panels[0].empty);
  CHECK(layout.panels[1].empty);
  CHECK_FALSE(layout.panels[2].empty);
}

TEST_CASE("chart layout: a name has one style, and 42 names have different styles", "[chart]") {
  Chart chart = chart_of(2, 2, 42);
  std::ranges::reverse(chart.panels[1].series);
  const std::vector<SeriesStyle> styles = styles_of(chart);
  REQUIRE(styles.size() == 42);
  CHECK(styles[0].name == "series 0");
  std::set<std::tuple<double, double, double, Marker>> looks;
  for (const SeriesStyle& style : styles) {
    const Colour& c = style.colour;
    looks.insert({c.red, c.green, c.blue, style.marker});
    CHECK(0.2126 * c.red + 0.7152 * c.green + 0.0722 * c.blue < 0.7);  // not pale
  }
  CHECK(looks.size() == 42);
}

TEST_CASE("chart layout: text is wrapped at blanks and at line breaks", "[chart]") {
  const Ruler ruler;
  const std::string text =
      "Median of five runs. Bars from the fastest to the slowest of them.\n"
      "Averyveryverylongwordwithoutanyblank ends";
  const auto lines = wrapped(text, kNoteStyle, 120, ruler.canvas);
  std::string joined;
  for (const std::string& line : lines) {
    if (line.find(' ') != std::string::npos) {
      CHECK(ruler.canvas.text_width(line, kNoteStyle) <= 120);
    }
    joined += line + " ";
  }
  std::string plain = text + " ";
  std::ranges::replace(plain, '\n', ' ');
  CHECK(joined == plain);
  CHECK(lines.size() >= 5);
  CHECK(wrapped("", kNoteStyle, 120, ruler.canvas).empty());
}
