// Summaries of several runs and of many errors, and the power law by which a quantity grows.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace ptc {

/// The median and the range of the values of several runs, in their unit.
struct Spread {
  double median = 0;  ///< middle value; mean of the two in the middle of an even number
  double low = 0;     ///< minimum
  double high = 0;    ///< maximum
};

/// A value, and a spread, that was not measured.
inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
inline constexpr Spread kNoSpread{kNone, kNone, kNone};

/// Summarises the values of several runs.
/// @throws std::invalid_argument when there is no value, or one is NaN
[[nodiscard]] Spread spread_of(std::vector<double> values);

/// A spread in another unit: all three values times `factor`.
[[nodiscard]] Spread scaled(const Spread& spread, double factor) noexcept;

/// How far values are from their reference, in their unit.
struct ErrorStatistics {
  std::size_t count = 0;     ///< pairs compared
  double rms = 0;            ///< root of the mean square of ours - reference
  double bias = 0;           ///< mean of ours - reference
  double percentile_99 = 0;  ///< least value that 99 % of absolute errors do not exceed
  double reference_mean = 0;
};

/// Compares values of equal indices. Colours are compared channel by channel. Where an error is
/// NaN, so are rms, bias and percentile.
/// @throws std::invalid_argument when the two have different numbers of values, or none
/// Memory: 8 bytes a pair.
[[nodiscard]] ErrorStatistics error_statistics(std::span<const float> ours,
                                               std::span<const float> reference);
/// Overload for doubles.
[[nodiscard]] ErrorStatistics error_statistics(std::span<const double> ours,
                                               std::span<const double> reference);

/// Converts errors to shares of the reference's mean, for quantities without a scale of their own,
/// such as irradiance. The mean itself stays as it is. Where it is not above 0, errors are NaN.
[[nodiscard]] ErrorStatistics over_mean(const ErrorStatistics& errors) noexcept;

/// The law y = factor * x^exponent.
struct PowerLaw {
  double factor = 0, exponent = 0;
  /// The value of the law at x.
  [[nodiscard]] double at(double x) const;
};

/// Fits a power law by least squares of log y against log x. Factor and exponent are NaN where all
/// x are equal or there is no point.
/// @param points  x and y, above 0
[[nodiscard]] PowerLaw fit_power_law(const std::vector<std::pair<double, double>>& points);

}  // namespace ptc
