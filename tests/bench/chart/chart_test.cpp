// The files of charts.
#include "tools/bench/chart/chart.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/io/image/image.h"
#include "engine/io/image/srgb.h"
#include "tests/support/slurp.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Chart sample() {
  ChartPanel first{"Dragon", "time (s)", "error (%)"};
  first.series = {{"ours", {{1, 9, 0.8, 1.3, "0.08 sr"}, {4, 3}, {20, 1}}},
                  {"rays & <more>", {{3, 30}, {30, 9}, {300, 3}}, true}};
  first.limits = {{2, "visible"}};
  ChartPanel second = first;
  second.title = std::string("City");
  second.series.erase(second.series.begin());
  return {"Error over time", "Median of 5 runs.", {first, second}, 2};
}

Image drawn(const test::TemporaryDirectory& scratch, const Chart& chart) {
  write_chart(scratch.path() / "drawn.png", chart);
  return read_image(scratch.path() / "drawn.png");
}

std::string svg_of(const test::TemporaryDirectory& scratch, const Chart& chart) {
  write_chart(scratch.path() / "drawn.svg", chart);
  return slurp(scratch.path() / "drawn.svg");
}

// Returns the number after the first `name`, which ends in "px".
unsigned long attribute(const std::string& svg, const std::string& name) {
  const std::size_t begin = svg.find(name);
  REQUIRE(begin != std::string::npos);
  std::size_t digits = 0;
  const unsigned long value = std::stoul(svg.substr(begin + name.size(), 10), &digits);
  CHECK(svg.compare(begin + name.size() + digits, 3, "px\"") == 0);
  return value;
}

// Counts the pixels of an 8-bit sRGB colour in the left or the right half of a picture.
std::size_t count_of(const Image& image, bool right, int red, int green, int blue) {
  const glm::vec3 colour(srgb_to_linear(red / 255.0), srgb_to_linear(green / 255.0),
                         srgb_to_linear(blue / 255.0));
  std::size_t count = 0;
  for (unsigned y = 0; y < image.height; ++y) {
    for (unsigned x = 0; x < image.width; ++x) {
      if ((x >= image.width / 2) != right) continue;
      const glm::vec3 d = image.at(x, y) - colour;
      count += std::abs(d.x) + std::abs(d.y) + std::abs(d.z) < 1e-3F ? 1U : 0U;
    }
  }
  return count;
}

void check_refused(const test::TemporaryDirectory& scratch, const char* name, const Chart& chart) {
  CHECK_THROWS_AS(write_chart(scratch.path() / name, chart), std::invalid_argument);
  CHECK(scratch.listing().empty());
}

}  // namespace

TEST_CASE("chart: an SVG can be searched for titles, axes, names and the note", "[chart]") {
  const test::TemporaryDirectory scratch;
  const std::string svg = svg_of(scratch, sample());
  CHECK(scratch.listing() == "drawn.svg");
  CHECK_THAT(svg, Catch::Matchers::StartsWith("<?xml"));
  CHECK_THAT(svg, Contains("<title>Error over time</title>"));
  CHECK_THAT(svg, Contains("Dragon: error (%) over time (s)\nCity: error"));
  CHECK_THAT(svg, Contains("\nours\nrays &amp; &lt;more&gt;\nMedian of 5 runs.</desc>"));
  CHECK_THAT(svg, Catch::Matchers::EndsWith("</svg>\n"));
  const std::size_t title = svg.find("<title>");
  CHECK(svg.find("<svg") < title);
  CHECK(title < svg.find("<path"));
}

TEST_CASE("chart: equal charts give equal bytes, whatever was drawn before", "[chart]") {
  const test::TemporaryDirectory scratch;
  const std::string svg = svg_of(scratch, sample());
  static_cast<void>(drawn(scratch, sample()));
  const std::string png = slurp(scratch.path() / "drawn.png");
  CHECK(svg_of(scratch, sample()) == svg);
  static_cast<void>(drawn(scratch, sample()));
  CHECK(slurp(scratch.path() / "drawn.png") == png);
  Chart other = sample();
  other.panels[1].series[0].points[2].y = 4;
  CHECK(svg_of(scratch, other) != svg);
}

TEST_CASE("chart: a PNG has two pixels per unit and is mostly white", "[chart]") {
  const test::TemporaryDirectory scratch;
  const Image image = drawn(scratch, sample());
  const std::string svg = svg_of(scratch, sample());
  CHECK(image.width == 2 * attribute(svg, " width=\""));
  CHECK(image.height == 2 * attribute(svg, " height=\""));
  const std::size_t white =
      count_of(image, false, 255, 255, 255) + count_of(image, true, 255, 255, 255);
  CHECK(white > image.pixels.size() * 8 / 10);
  CHECK(white < image.pixels.size() * 98 / 100);
  CHECK(image.at(0, 0) == glm::vec3(1));
}

TEST_CASE("chart: a name keeps its colour in another panel", "[chart]") {
  const test::TemporaryDirectory scratch;
  const Image image = drawn(scratch, sample());      // the legend is in the left half
  CHECK(count_of(image, false, 0, 114, 178) > 200);  // ours
  CHECK(count_of(image, false, 213, 94, 0) > 200);   // rays
  CHECK(count_of(image, true, 0, 114, 178) == 0);
  CHECK(count_of(image, true, 213, 94, 0) > 200);
}

TEST_CASE("chart: a panel without points says so in its middle", "[chart]") {
  const test::TemporaryDirectory scratch;
  Chart chart{"", "", {ChartPanel{}}, 1};
  const Image empty = drawn(scratch, chart);
  const auto dark = [](const Image& image) {
    std::size_t count = 0;
    for (unsigned y = image.height / 4; y < image.height * 3 / 4; ++y) {
      for (unsigned x = image.width / 4; x < image.width * 3 / 4; ++x) {
        count += image.at(x, y).x < 0.5F ? 1U : 0U;
      }
    }
    return count;
  };
  CHECK(dark(empty) > 100);
  chart.panels[0].series = {{"", {{1, 1}, {1000, 1000}}}};
  chart.panels[0].series[0].points.erase(chart.panels[0].series[0].points.begin());
  CHECK(dark(drawn(scratch, chart)) < dark(empty));
}

TEST_CASE("chart: a line is broken where a point cannot be shown", "[chart]") {
  const test::TemporaryDirectory scratch;
  const auto ink = [&](double y) {
    ChartPanel panel;
    panel.series = {{"a", {{1, 1}, {10, y}, {100, 1}}}};
    const Image image = drawn(scratch, {"", "", {panel}, 1});
    return count_of(image, false, 0, 114, 178) + count_of(image, true, 0, 114, 178);
  };
  CHECK(ink(1) > 3 * ink(NAN) / 2);
  CHECK(ink(-1) == ink(NAN));
}

TEST_CASE("chart: the drawing shows dashes, bars, limits and labels", "[chart]") {
  const test::TemporaryDirectory scratch;
  const Chart chart = sample();
  const std::string whole = svg_of(scratch, chart);
  const auto differs = [&](auto&& change) {
    Chart changed = chart;
    change(changed.panels);
    return svg_of(scratch, changed) != whole;
  };
  using Panels = std::vector<ChartPanel>;
  CHECK_FALSE(differs([](Panels&) {}));
  CHECK(differs([](Panels& panels) { panels[0].series[1].dashed = false; }));
  CHECK(differs([](Panels& panels) { panels[1].series[0].dashed = false; }));
  CHECK(differs([](Panels& panels) { panels[0].series[0].points[0].x_low = 0.9; }));
  CHECK(differs([](Panels& panels) { panels[0].series[0].points[1].x_low = 3; }));
  CHECK(differs([](Panels& panels) { panels[0].series[0].points[1].x_low = -1; }));
  CHECK_FALSE(differs([](Panels& panels) { panels[0].series[0].points[1].x_high = kInfinity; }));
  CHECK(differs([](Panels& panels) { panels[0].series[0].points[0].label.append("more"); }));
  CHECK(differs([](Panels& panels) { panels[0].limits[0].label.append("more"); }));
  CHECK(differs([](Panels& panels) { panels[0].limits.push_back({5, ""}); }));
  CHECK_FALSE(differs([](Panels& panels) { panels[0].limits.push_back({1.7e308, "far"}); }));
  CHECK_FALSE(differs([](Panels& panels) { panels[0].limits.push_back({-1, "below"}); }));
  CHECK_FALSE(differs([](Panels& panels) { panels[0].limits.push_back({NAN, "none"}); }));
  // A bar from x to x is not drawn.
  CHECK_FALSE(differs([](Panels& panels) {
    ChartPoint& point = panels[0].series[0].points[1];
    point.x_low = point.x_high = point.x;
  }));
}

TEST_CASE("chart: no value of any kind breaks a drawing", "[chart]") {
  const test::TemporaryDirectory scratch;
  for (const double value : {0.0, -1.0, double{NAN}, kInfinity, -kInfinity, 1.7e308, -1.7e308,
                             2.3e-308, 5e-324, 4e307}) {
    Chart chart{"", "", {}, 4};
    for (const bool log : {false, true}) {
      for (int place = 0; place < 4; ++place) {
        ChartPanel panel{
            "", "", "", log, log, {{"a", {{1, 2}, {3, 4, 2, 5}, {6, 7}}}}, {{value, "l"}}};
        ChartPoint& point = panel.series[0].points[1];
        (place == 0   ? point.x
         : place == 1 ? point.y
         : place == 2 ? point.x_low
                      : point.x_high) = value;
        chart.panels.push_back(panel);
      }
    }
    const std::string svg = svg_of(scratch, chart);
    CHECK(svg.find("nan") == std::string::npos);
    CHECK(svg.find("inf") == std::string::npos);
  }
}

TEST_CASE("chart: what cannot be drawn is refused and leaves no file", "[chart]") {
  const test::TemporaryDirectory scratch;
  check_refused(scratch, "a.pdf", sample());
  check_refused(scratch, "svg", sample());
  check_refused(scratch, "a.svg", {});
  Chart chart = sample();
  chart.columns = 0;
  check_refused(scratch, "a.svg", chart);
  chart = sample();
  chart.panels[0].title = std::string("\xff");
  check_refused(scratch, "a.svg", chart);
  check_refused(scratch, "a.png", chart);
  chart = sample();
  chart.panels.resize(200);
  chart.columns = 1;
  check_refused(scratch, "a.png", chart);
  check_refused(scratch, "a.svg", chart);
}

TEST_CASE("chart: a target that cannot be written keeps its old content", "[chart]") {
  const test::TemporaryDirectory scratch;
  for (const char* ending : {".svg", ".png"}) {
    const auto name = std::string("a") + ending;
    CHECK_THROWS_AS(write_chart(scratch.path() / "none" / name, sample()), std::system_error);
    CHECK(scratch.listing().empty());
    std::filesystem::create_directory(scratch.path() / name);
    CHECK_THROWS_AS(write_chart(scratch.path() / name, sample()), std::system_error);
    CHECK(scratch.listing() == name);
    std::filesystem::remove(scratch.path() / name);
  }
}
