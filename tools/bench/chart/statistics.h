// What a set of runs and a set of errors come to, and the law by which something grows.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace ptc {

/// Values of several runs, in their unit.
struct Spread {
  double median = 0;  ///< of an even number of values, the mean of the two in the middle
  double low = 0;
  double high = 0;
};

/// What was not measured.
inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
inline constexpr Spread kNoSpread{kNone, kNone, kNone};

/// @throws std::invalid_argument when there is no value, or one is no number
[[nodiscard]] Spread spread_of(std::vector<double> values);

/// The same runs in another unit.
[[nodiscard]] Spread scaled(const Spread& spread, double factor) noexcept;

/// How far values are from their reference, in their unit.
struct ErrorStatistics {
  std::size_t count = 0;     ///< pairs compared
  double rms = 0;            ///< root of the mean square of ours - reference
  double bias = 0;           ///< mean of ours - reference
  double percentile_99 = 0;  ///< least absolute error that 99 % of all do not exceed
  double reference_mean = 0;
};

/// Of pairs of the same index. Colours are compared as their channels, one after the other. Where
/// an error is no number, rms, bias and percentile are none.
/// @throws std::invalid_argument when there are not equally many, or none
/// Memory: 8 bytes a pair.
[[nodiscard]] ErrorStatistics error_statistics(std::span<const float> ours,
                                               std::span<const float> reference);
[[nodiscard]] ErrorStatistics error_statistics(std::span<const double> ours,
                                               std::span<const double> reference);

/// The same errors as shares of the reference's mean, which stays as it is: for quantities without
/// a scale of their own, as irradiance. Errors of a reference whose mean is not above 0 are NaN.
[[nodiscard]] ErrorStatistics over_mean(const ErrorStatistics& errors) noexcept;

/// y = factor x^exponent.
struct PowerLaw {
  double factor = 0, exponent = 0;
  [[nodiscard]] double at(double x) const;
};

/// Least squares of log y against log x; NaN where all x are equal or there is no point.
/// @param points  x and y, above 0
[[nodiscard]] PowerLaw fit_power_law(const std::vector<std::pair<double, double>>& points);

}  // namespace ptc
