// Steps of ticks climb a ladder, and so do their indices:
//
//   step    ...  0.2  0.5   1   2   5   10   20   50   100 ...
//   index   ...   -2   -1   0   1   2    3    4    5     6 ...     index = 3 * exponent + digit
//
// Values are computed as digit * 10^exponent or digit / 10^-exponent, which rounds once, so that a
// tick at 0.3 is the double 0.3 and its label is "0.3".
#include "tools/bench/chart/axis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace ptc {
namespace {

constexpr double kAir = 0.06;  // share of the values' interval added at an end
constexpr double kMinRatio =
    1.25;  // least high / low of a log axis, so that noise is not magnified
constexpr double kMax = std::numeric_limits<double>::max() / 4;  // differences stay finite
constexpr int kMaxLinear = 8;                                    // ticks
constexpr double kMin = std::numeric_limits<double>::min();

// Returns digit * 10^exponent, rounded once where that is possible.
double decimal(double digit, int exponent) {
  return exponent < 0 ? digit / std::pow(10.0, -exponent) : digit * std::pow(10.0, exponent);
}

int floor_exponent(double value) {
  return static_cast<int>(std::floor(std::log10(value)));
}

constexpr std::array<double, 3> kDigits = {1, 2, 5};

// A step of the ladder: 1, 2, 5, 10, 20 ... have the indices 0, 1, 2, 3, 4 ...; 0.5 has -1.
struct Step {
  explicit Step(int index)
      : exponent(index >= 0 ? index / 3 : -((2 - index) / 3)),
        digit(kDigits[static_cast<std::size_t>(index - 3 * exponent)]) {}
  [[nodiscard]] double times(double count) const { return decimal(count * digit, exponent); }

  int exponent;
  double digit;
};

std::vector<double> linear_ticks(const Axis& axis, unsigned coarseness) {
  const double least = (axis.high - axis.low) / (kMaxLinear - 1);
  int index = 3 * floor_exponent(least);
  while (Step(index).times(1) < least) ++index;
  const Step step(index + static_cast<int>(coarseness));
  const double first =
      std::ceil(axis.low / step.times(1)) - 1;  // one less, for it may be rounded up
  std::vector<double> ticks;
  for (int i = 0; i <= kMaxLinear + 1; ++i) {
    const double value = step.times(first + i);
    if (value >= axis.low && value <= axis.high) ticks.push_back(value + 0.0);  // + 0: no -0
  }
  return ticks;
}

std::vector<double> log_ticks(const Axis& axis, std::span<const double> digits, int decades) {
  std::vector<double> ticks;
  const int last = floor_exponent(axis.high);
  for (int exponent = floor_exponent(axis.low); exponent <= last; ++exponent) {
    if (exponent % decades != 0) continue;
    for (const double digit : digits) {
      const double value = decimal(digit, exponent);
      if (value >= axis.low && value <= axis.high) ticks.push_back(value);
    }
  }
  return ticks;
}

// A number in raised digits, for exponents.
std::string superscript(int number) {
  constexpr std::array<std::string_view, 10> kRaised = {"⁰", "¹", "²", "³", "⁴",
                                                        "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string raised;
  for (const char c : std::to_string(number)) {
    raised += c == '-' ? "⁻" : kRaised[static_cast<std::size_t>(c - '0')];
  }
  return raised;
}

// A value as "2·10⁻⁴", or as "10⁻⁴" where the factor is 1.
std::string power_label(double value) {
  int exponent = floor_exponent(value * 1.0000001);
  const std::string digits = fmt::format("{:.6g}", value / decimal(1, exponent));
  return (digits == "1" ? "" : digits + "·") + "10" + superscript(exponent);
}

}  // namespace

double Axis::share(double value) const noexcept {
  if (!log) return (value - low) / (high - low);
  return (std::log(value) - std::log(low)) / (std::log(high) - std::log(low));
}

bool can_show(double value, bool log) noexcept {
  return std::abs(value) <= kMax && (!log || value >= kMin);
}

Axis axis_around(std::span<const double> values, bool log) {
  // Find the values' interval
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : values) {
    if (!can_show(value, log)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // Add the margin, on a log axis as a factor
  if (log) {
    if (low > high) return {1, 10, true};
    const double span = std::log(high) - std::log(low);
    const double air = std::exp(std::max(kAir * span, (std::log(kMinRatio) - span) / 2));
    return {std::max(low / air, kMin), std::min(high * air, 4 * kMax), true};
  }
  if (low > high || (low == 0 && high == 0)) return {0, 1, false};
  if (low >= 0 && low <= high / 2) return {0, high * (1 + kAir), false};
  // Treat values that differ only by rounding as equal
  const double span = high - low;
  const double largest = std::max(std::abs(low), std::abs(high));
  const double air = span > 1e-9 * largest ? span * kAir : largest * 0.1;
  return {low - air, high + air, false};
}

std::vector<double> ticks_of(const Axis& axis, unsigned coarseness) {
  if (!axis.log || log_ticks(axis, kDigits, 1).size() < 3) return linear_ticks(axis, coarseness);
  if (coarseness == 0) return log_ticks(axis, kDigits, 1);
  return log_ticks(axis, std::array{1.0}, static_cast<int>(coarseness));
}

std::vector<double> ticks_that_fit(const Axis& axis,
                                   const std::function<bool(std::span<const double>)>& fits) {
  std::vector<double> ticks = ticks_of(axis, 0);
  for (unsigned coarseness = 1; !fits(ticks); ++coarseness) {
    std::vector<double> coarser = ticks_of(axis, coarseness);
    if (coarser.size() < 2) break;
    ticks = std::move(coarser);
  }
  return ticks;
}

std::vector<double> minor_ticks(const Axis& axis) {
  if (!axis.log || axis.high / axis.low > 1e6) return {};
  return log_ticks(axis, std::array{1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0}, 1);
}

std::string tick_label(double value) {
  if (value == 0) return "0";
  if (value < 0) return "−" + tick_label(-value);
  if (value < 0.000999999 || value >= 9.99999e14) return power_label(value);
  constexpr std::array<std::string_view, 5> kSuffixes = {"", "k", "M", "G", "T"};
  std::size_t suffix = 0;
  while (value >= 999.999) {
    value /= 1000;
    ++suffix;
  }
  return fmt::format("{:.6g}{}", value, kSuffixes[suffix]);
}

}  // namespace ptc
