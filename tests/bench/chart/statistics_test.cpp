// Spreads and errors, compared with values computed by hand.
#include "tools/bench/chart/statistics.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

using namespace ptc;

TEST_CASE("spread: it is right for odd and even numbers of runs in any order",
          "[chart][statistics]") {
  const Spread one = spread_of({7});
  CHECK(one.median == 7);
  CHECK(one.low == 7);
  CHECK(one.high == 7);
  const Spread odd = spread_of({9, 1, 4, 2, 100});
  CHECK(odd.median == 4);
  CHECK(odd.low == 1);
  CHECK(odd.high == 100);
  CHECK(spread_of({8, 2, -4, 3}).median == 2.5);
  CHECK(spread_of({3, 5}).median == 4);
}

TEST_CASE("spread: no runs and NaN are refused", "[chart][statistics]") {
  CHECK_THROWS_AS(spread_of({}), std::invalid_argument);
  CHECK_THROWS_AS(spread_of({1, NAN, 2}), std::invalid_argument);
}

TEST_CASE("errors: four pairs have the errors computed by hand", "[chart][statistics]") {
  // Differences 1, -1, 3, 1: squares 12, sum 4.
  const std::vector<double> ours = {2, 1, 6, 5};
  const std::vector<double> reference = {1, 2, 3, 4};
  const ErrorStatistics errors = error_statistics(ours, reference);
  CHECK(errors.count == 4);
  CHECK(errors.rms == Approx(std::sqrt(3.0)).epsilon(1e-15));
  CHECK(errors.bias == 1);
  CHECK(errors.percentile_99 == 3);
  CHECK(errors.reference_mean == 2.5);
  const ErrorStatistics relative = over_mean(errors);
  CHECK(relative.rms == Approx(std::sqrt(3.0) / 2.5).epsilon(1e-15));
  CHECK(relative.bias == Approx(0.4).epsilon(1e-15));
  CHECK(relative.percentile_99 == Approx(1.2).epsilon(1e-15));
  CHECK(relative.reference_mean == 2.5);
}

TEST_CASE("errors: floats give the errors of the same values as doubles", "[chart][statistics]") {
  const std::vector<float> ours = {0.1F, 1, 1e8F};
  const std::vector<float> reference = {0.2F, 1e-9F, 99999992.0F};
  const ErrorStatistics errors = error_statistics(ours, reference);
  const ErrorStatistics same =
      error_statistics(std::vector<double>(ours.begin(), ours.end()),
                       std::vector<double>(reference.begin(), reference.end()));
  CHECK(errors.rms == same.rms);
  CHECK(errors.bias == same.bias);
  CHECK(errors.percentile_99 == 8);
}

TEST_CASE("errors: the 99th percentile is the nearest rank of the absolute errors",
          "[chart][statistics]") {
  // Errors 1, -2, 3, ... -+n: the rank is ceil(0.99 n).
  const auto percentile = [](std::size_t n) {
    std::vector<double> ours;
    for (std::size_t i = 1; i <= n; ++i) {
      ours.push_back(i % 2 == 0 ? -static_cast<double>(i) : static_cast<double>(i));
    }
    return error_statistics(ours, std::vector<double>(n)).percentile_99;
  };
  CHECK(percentile(1) == 1);
  CHECK(percentile(99) == 99);
  CHECK(percentile(100) == 99);
  CHECK(percentile(101) == 100);
  CHECK(percentile(199) == 198);
  CHECK(percentile(200) == 198);
  CHECK(percentile(1000) == 990);
}

TEST_CASE("errors: a single NaN makes every figure NaN", "[chart][statistics]") {
  std::vector<double> ours(300, 1);
  const std::vector<double> reference(300, 0.5);
  for (std::size_t i = 0; i < ours.size(); i += 2) ours[i] = NAN;
  const ErrorStatistics errors = error_statistics(ours, reference);
  CHECK(std::isnan(errors.rms));
  CHECK(std::isnan(errors.bias));
  CHECK(std::isnan(errors.percentile_99));
}

TEST_CASE("errors: unequal numbers of values and no values are refused", "[chart][statistics]") {
  const std::vector<double> two(2);
  const std::vector<double> three(3);
  CHECK_THROWS_AS(error_statistics(two, three), std::invalid_argument);
  CHECK_THROWS_AS(error_statistics(std::vector<double>{}, std::vector<double>{}),
                  std::invalid_argument);
}

TEST_CASE("errors: a reference without a mean above 0 has no relative error",
          "[chart][statistics]") {
  const std::vector<double> ours = {1, 2};
  const std::vector<double> black = {0, 0};
  const ErrorStatistics relative = over_mean(error_statistics(ours, black));
  CHECK(std::isnan(relative.rms));
  CHECK(std::isnan(relative.bias));
  CHECK(std::isnan(relative.percentile_99));
  CHECK(relative.reference_mean == 0);
}

TEST_CASE("power law: an exact law is recovered, and a noisy one through its middle", "[chart]") {
  const PowerLaw exact =
      fit_power_law({{1, 3}, {10, 3 * std::pow(10, 0.7)}, {1000, 3 * std::pow(1000, 0.7)}});
  CHECK(exact.factor == Approx(3));
  CHECK(exact.exponent == Approx(0.7));
  CHECK(exact.at(1e6) == Approx(3 * std::pow(1e6, 0.7)));
  const PowerLaw noisy = fit_power_law({{1, 2}, {1, 0.5}, {100, 20}, {100, 5}});
  CHECK(noisy.factor == Approx(1));
  CHECK(noisy.exponent == Approx(0.5));
  CHECK(std::isnan(fit_power_law({{5, 1}}).exponent));
  for (const double x : {3.0, 7.0, 1e6})
    CHECK(std::isnan(fit_power_law({{x, 1}, {x, 2}, {x, 4}}).at(x)));
}
