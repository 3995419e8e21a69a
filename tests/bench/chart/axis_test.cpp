// Intervals, ticks and labels of axes.
#include "tools/bench/chart/axis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

using namespace ptc;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Values = std::vector<double>;

Axis around(const Values& values, bool log) {
  return axis_around(values, log);
}

// Returns the labels of ticks: what a reader sees, free of rounding.
std::string names(const Values& ticks) {
  std::string text;
  for (const double tick : ticks) text.append(text.empty() ? "" : " ").append(tick_label(tick));
  return text;
}

}  // namespace

TEST_CASE("axis: a logarithmic axis has ticks at 1, 2 and 5 of each decade", "[chart][axis]") {
  const Axis axis{3, 700, true};
  CHECK(names(ticks_of(axis)) == "5 10 20 50 100 200 500");
  CHECK(names(ticks_of(axis, 1)) == "10 100");
  CHECK(names(ticks_of(axis, 2)) == "100");
  CHECK(names(ticks_of({0.002, 0.1, true})) == "0.002 0.005 0.01 0.02 0.05 0.1");
  CHECK(names(ticks_of({0.5, 2e7, true}, 2)) == "1 100 10k 1M");
}

TEST_CASE("axis: a logarithmic axis with fewer than three such ticks has linear ones",
          "[chart][axis]") {
  CHECK(names(ticks_of({21, 90, true})) == "30 40 50 60 70 80 90");
  CHECK(names(ticks_of({21, 90, true}, 1)) == "40 60 80");
  CHECK(names(ticks_of({15, 90, true})) == "20 40 60 80");
  CHECK(names(ticks_of({1.01, 1.3, true})) == "1.05 1.1 1.15 1.2 1.25 1.3");
  CHECK(names(ticks_of({20, 100, true})) == "20 50 100");
}

TEST_CASE("axis: a linear axis has ticks at multiples of 1, 2 or 5", "[chart][axis]") {
  CHECK(names(ticks_of({0, 1})) == "0 0.2 0.4 0.6 0.8 1");
  CHECK(names(ticks_of({0, 1}, 1)) == "0 0.5 1");
  CHECK(names(ticks_of({0, 1}, 2)) == "0 1");
  CHECK(names(ticks_of({-3, 4})) == "−3 −2 −1 0 1 2 3 4");
  CHECK(names(ticks_of({0, 953})) == "0 200 400 600 800");
  CHECK(names(ticks_of({0.12, 0.19})) == "0.12 0.13 0.14 0.15 0.16 0.17 0.18 0.19");
}

TEST_CASE("axis: ticks of any interval lie inside, ascend and are few", "[chart][axis]") {
  for (int exponent = -290; exponent <= 290; exponent += 29) {
    for (const double ratio : {1.0001, 1.3, 2.0, 9.0, 1e3, 1e9}) {
      const double low = 1.7 * std::pow(10.0, exponent);
      for (const Axis& axis : {Axis{low, low * ratio, false}, Axis{low, low * ratio, true},
                               Axis{-low * ratio, -low, false}, Axis{-low, low * ratio, false}}) {
        for (unsigned coarseness = 0; coarseness < 4; ++coarseness) {
          const Values ticks = ticks_of(axis, coarseness);
          CAPTURE(axis.low, axis.high, axis.log, coarseness);
          REQUIRE(std::ranges::is_sorted(ticks, std::less_equal<>()));
          REQUIRE(ticks.size() <= (axis.log ? 30 : 8));
          if (coarseness == 0) REQUIRE(ticks.size() >= 3);
          for (const double tick : ticks) {
            REQUIRE(tick >= axis.low);
            REQUIRE(tick <= axis.high);
          }
        }
      }
    }
  }
}

TEST_CASE("axis: the finest ticks that fit are chosen, and two when none fit", "[chart][axis]") {
  const Axis axis{3, 70000, true};
  const auto at_most = [&](std::size_t most) {
    return names(ticks_that_fit(
        axis, [most](std::span<const double> ticks) { return ticks.size() <= most; }));
  };
  CHECK(at_most(20) == "5 10 20 50 100 200 500 1k 2k 5k 10k 20k 50k");
  CHECK(at_most(12) == "10 100 1k 10k");
  CHECK(at_most(3) == "100 10k");
  CHECK(at_most(0) == "100 10k");
}

TEST_CASE("axis: minor ticks are all nine of a decade, and only on few decades", "[chart][axis]") {
  CHECK(names(minor_ticks({7, 31, true})) == "7 8 9 10 20 30");
  CHECK(minor_ticks({7, 31, false}).empty());
  CHECK(minor_ticks({1, 1.1e6, true}).empty());
}

TEST_CASE("axis: values lie inside with a margin around them", "[chart][axis]") {
  for (const bool log : {false, true}) {
    for (const Values& values : {Values{3, 700}, Values{650, 700}, Values{5}, Values{1e-300, 1e300},
                                 Values{1e15, 1e15 + 1}, Values{4e307, 1e-300}}) {
      const Axis axis = around(values, log);
      CAPTURE(axis.low, axis.high, log);
      CHECK(axis.log == log);
      CHECK(std::isfinite(axis.high));
      for (const double value : values) {
        CHECK(axis.share(value) >= (axis.low == 0 ? 0 : 0.001));
        CHECK(axis.share(value) <= 0.999);
      }
    }
  }
  CHECK(around({-2, 1}, false).low == Approx(-2.18));
}

TEST_CASE("axis: a linear axis begins at 0 unless that wastes more than half", "[chart][axis]") {
  CHECK(around({3, 6}, false).low == 0);
  CHECK(around({0, 6}, false).low == 0);
  CHECK(around({3.1, 6}, false).low > 2.5);
  CHECK(around({-0.1, 6}, false).low < -0.1);
}

TEST_CASE("axis: a logarithmic axis does not magnify differences of a few percent",
          "[chart][axis]") {
  const Axis axis = around({100, 101}, true);
  CHECK(axis.high / axis.low == Approx(1.25));
  CHECK(axis.share(std::sqrt(100.0 * 101)) == Approx(0.5));
}

TEST_CASE("axis: values that it cannot show do not stretch it", "[chart][axis]") {
  const Values odd = {NAN, kInfinity, -kInfinity, 5, 50};
  CHECK(around(odd, false).high == Approx(53));
  CHECK(around({0, -3, 5, 50}, true).low == around({5, 50}, true).low);
  for (const bool log : {false, true}) {
    const Axis axis = around({NAN, kInfinity}, log);
    CHECK(axis.low < axis.high);
    CHECK((axis.low > 0 || !log));
  }
  CHECK(can_show(-3, false));
  for (const double value : {0.0, -3.0, 5e-324, kInfinity, double{NAN}}) {
    CHECK_FALSE(can_show(value, true));
  }
}

TEST_CASE("axis: shares are even in values or in their logarithms", "[chart][axis]") {
  CHECK(Axis{10, 30, false}.share(15) == Approx(0.25));
  CHECK(Axis{10, 1000, true}.share(100) == Approx(0.5));
  CHECK(Axis{10, 1000, true}.share(10) == 0);
  CHECK(Axis{10, 1000, true}.share(1000) == 1);
}

TEST_CASE("axis: labels are short", "[chart][axis]") {
  CHECK(tick_label(0) == "0");
  CHECK(tick_label(0.1 + 0.2) == "0.3");
  CHECK(tick_label(-2.5) == "−2.5");
  CHECK(tick_label(0.001) == "0.001");
  CHECK(tick_label(0.0002) == "2·10⁻⁴");
  CHECK(tick_label(1e-13) == "10⁻¹³");
  CHECK(tick_label(999) == "999");
  CHECK(tick_label(1000) == "1k");
  CHECK(tick_label(1500) == "1.5k");
  CHECK(tick_label(20000) == "20k");
  CHECK(tick_label(1e6) == "1M");
  CHECK(tick_label(2e9) == "2G");
  CHECK(tick_label(5e14) == "500T");
  CHECK(tick_label(1e15) == "10¹⁵");
}
