// Where values lie along an axis, and which of them it names.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace ptc {

/// An interval of values, low < high; both above 0 when it is logarithmic.
struct Axis {
  double low = 0;
  double high = 1;
  bool log = false;

  /// 0 at low to 1 at high.
  [[nodiscard]] double share(double value) const noexcept;
};

/// Whether an axis can show a value: finite, and above 0 when it is logarithmic.
[[nodiscard]] bool can_show(double value, bool log) noexcept;

/// An axis with all values that it can show and some air around them. A logarithmic one covers a
/// factor of 1.25 at least; a linear one begins at 0 when no value is below it and the least is at
/// most half of the greatest.
[[nodiscard]] Axis axis_around(std::span<const double> values, bool log);

/// Round values on an axis, ascending. Logarithmic: 1, 2 and 5 of each decade, coarser each decade,
/// each second, third and so on; where that gives fewer than 3, as linear. Linear: multiples of 1,
/// 2 or 5 times a power of ten, at most 8 of them, coarser each time one step up that ladder.
[[nodiscard]] std::vector<double> ticks_of(const Axis& axis, unsigned coarseness = 0);

/// The finest ticks for which `fits` holds; when none does, the coarsest that are more than one.
[[nodiscard]] std::vector<double> ticks_that_fit(
    const Axis& axis, const std::function<bool(std::span<const double>)>& fits);

/// All of 1 to 9 of each decade, for short marks without names; none on a linear axis or over more
/// than 6 decades.
[[nodiscard]] std::vector<double> minor_ticks(const Axis& axis);

/// "0.05", "500", "20k", "1.5M", "2·10⁻⁴" ...: at most 6 digits; k, M, G and T for thousands,
/// millions and so on.
[[nodiscard]] std::string tick_label(double value);

}  // namespace ptc
