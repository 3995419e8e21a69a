// Order statistics, moments and a straight line through logarithms.
#include "tools/bench/chart/statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

namespace ptc {
namespace {

// The 99th percentile by nearest rank: the value at ceil(0.99 n), counted from 1, of n sorted
// values.
double percentile_99(std::vector<double>& values) {
  const std::size_t rank = values.size() - values.size() / 100;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::ranges::nth_element(values, at);
  return *at;
}

template <class Value>
ErrorStatistics statistics_of(std::span<const Value> ours, std::span<const Value> reference) {
  if (ours.size() != reference.size() || ours.empty()) {
    throw std::invalid_argument("error_statistics: " + std::to_string(ours.size()) +
                                " values against " + std::to_string(reference.size()));
  }
  ErrorStatistics result{.count = ours.size()};
  std::vector<double> absolute(ours.size());
  double squares = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const double error = static_cast<double>(ours[i]) - static_cast<double>(reference[i]);
    absolute[i] = std::abs(error);
    squares += error * error;
    result.bias += error;
    result.reference_mean += static_cast<double>(reference[i]);
  }
  const auto count = static_cast<double>(ours.size());
  result.rms = std::sqrt(squares / count);
  result.bias /= count;
  result.reference_mean /= count;
  // The sum of squares is NaN if and only if an error is: such errors cannot be ordered.
  result.percentile_99 = std::isnan(squares) ? squares : percentile_99(absolute);
  return result;
}

}  // namespace

Spread spread_of(std::vector<double> values) {
  const auto is_nan = [](double value) { return std::isnan(value); };
  if (values.empty() || std::ranges::any_of(values, is_nan)) {
    throw std::invalid_argument("spread_of: there is no value, or one is not a number");
  }
  std::ranges::sort(values);
  const std::size_t upper = values.size() / 2;
  const std::size_t lower = (values.size() - 1) / 2;
  return {std::midpoint(values[lower], values[upper]), values.front(), values.back()};
}

Spread scaled(const Spread& spread, double factor) noexcept {
  return {spread.median * factor, spread.low * factor, spread.high * factor};
}

ErrorStatistics error_statistics(std::span<const float> ours, std::span<const float> reference) {
  return statistics_of(ours, reference);
}

ErrorStatistics error_statistics(std::span<const double> ours, std::span<const double> reference) {
  return statistics_of(ours, reference);
}

ErrorStatistics over_mean(const ErrorStatistics& errors) noexcept {
  const double mean = errors.reference_mean > 0 ? errors.reference_mean : kNone;
  return {errors.count, errors.rms / mean, errors.bias / mean, errors.percentile_99 / mean,
          errors.reference_mean};
}

double PowerLaw::at(double x) const {
  return factor * std::pow(x, exponent);
}

PowerLaw fit_power_law(const std::vector<std::pair<double, double>>& points) {
  const auto count = static_cast<double>(points.size());
  double mean_x = 0, mean_y = 0;
  for (const auto& [x, y] : points) {
    mean_x += std::log(x) / count;
    mean_y += std::log(y) / count;
  }
  // Sum the squares around the means
  double xx = 0, xy = 0;
  for (const auto& [x, y] : points) {
    xx += (std::log(x) - mean_x) * (std::log(x) - mean_x);
    xy += (std::log(x) - mean_x) * (std::log(y) - mean_y);
  }
  const bool equal = std::ranges::all_of(
      points, [&](const auto& point) { return point.first == points.front().first; });
  if (equal) return {kNone, kNone};
  return {std::exp(mean_y - xy / xx * mean_x), xy / xx};
}

}  // namespace ptc
