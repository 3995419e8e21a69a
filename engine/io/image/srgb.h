// The sRGB transfer curve between stored and linear values.
#pragma once

#include <cmath>

namespace ptc {

/// Returns the linear value of a stored one, both in [0, 1]. Source: IEC 61966-2-1:1999, 5.2.
[[nodiscard]] inline double srgb_to_linear(double stored) noexcept {
  return stored <= 0.04045 ? stored / 12.92 : std::pow((stored + 0.055) / 1.055, 2.4);
}

/// Returns the stored value of a linear one, both in [0, 1]; the inverse of srgb_to_linear().
[[nodiscard]] inline double linear_to_srgb(double linear) noexcept {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

}  // namespace ptc
