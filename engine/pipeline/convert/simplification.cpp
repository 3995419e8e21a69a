#include "engine/pipeline/convert/simplification.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ptc {

Flatness merging_of(double coarseness) noexcept {
  if (coarseness <= 0) return {};
  return {.height = 3 * coarseness,
          .turn = std::min(6 * coarseness, 1.0),
          .contrast = 3 * coarseness,
          .growth = 2.1 + 20 * coarseness,
          .reach = 1 + 3 * coarseness};
}

PointRounding rounding_of(double tolerance) noexcept {
  constexpr PointRounding kUsual;
  // With b bits, what is off by `of_no_bits` at most with none is off by 2^-b of that
  const auto bits = [](double of_no_bits, double most, int usual) {
    return std::clamp(static_cast<int>(std::ceil(std::log2(of_no_bits / most))), 1, usual);
  };
  return {.position = std::clamp(tolerance / 4, kUsual.position, 0.03),
          .radius_bits = bits(0.5, tolerance / 3, kUsual.radius_bits),
          .normal_bits =
              bits(std::ldexp(kRoundedNormal, kUsual.normal_bits), tolerance, kUsual.normal_bits),
          .radiance_bits = bits(0.5, 2 * tolerance / 3, kUsual.radiance_bits)};
}

double light_error(const PointRounding& rounding) noexcept {
  // Errors are spread evenly up to the greatest one
  return std::exp2(-rounding.radiance_bits - 1) / std::numbers::sqrt3;
}

}  // namespace ptc
