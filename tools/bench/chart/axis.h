// Where values lie along an axis, and which of them have a tick and a label.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace ptc {

/// An interval of values, low < high; both are above 0 when the axis is logarithmic.
struct Axis {
  double low = 0;
  double high = 1;
  bool log = false;

  /// The position of a value along the axis: 0 at low, 1 at high.
  [[nodiscard]] double share(double value) const noexcept;
};

/// Whether an axis can show a value: it must be finite, and above 0 on a logarithmic axis.
[[nodiscard]] bool can_show(double value, bool log) noexcept;

/// Makes an axis for all values that it can show, with a margin around them. A logarithmic axis
/// covers at least a factor of 1.25; a linear axis begins at 0 when no value is below 0 and the
/// minimum is at most half of the maximum.
[[nodiscard]] Axis axis_around(std::span<const double> values, bool log);

/// Round values on an axis, ascending.
///
///   coarseness   logarithmic axis               linear axis, at most 8 ticks
///   0            1, 2 and 5 of each decade      multiples of the finest step that gives so few
///   1            1 of each decade               multiples of the next step
///   2            1 of each second decade ...    ... of the ladder 1, 2, 5, 10, 20, 50 ...
///
/// A logarithmic axis on which 1, 2 and 5 give fewer than 3 ticks takes those of a linear axis.
[[nodiscard]] std::vector<double> ticks_of(const Axis& axis, unsigned coarseness = 0);

/// Returns the finest ticks for which `fits` holds, or the coarsest that are at least two where
/// none fit.
[[nodiscard]] std::vector<double> ticks_that_fit(
    const Axis& axis, const std::function<bool(std::span<const double>)>& fits);

/// The values 1 to 9 of each decade, for short marks without labels; none on a linear axis or over
/// more than 6 decades.
[[nodiscard]] std::vector<double> minor_ticks(const Axis& axis);

/// The text at a tick, such as "0.05", "500", "20k", "1.5M" and "2·10⁻⁴": at most 6 digits, with k,
/// M, G and T for thousands, millions and so on.
[[nodiscard]] std::string tick_label(double value);

}  // namespace ptc
