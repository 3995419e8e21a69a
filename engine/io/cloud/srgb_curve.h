// Internal to the readers and writers of points: the sRGB curve for stored integers.
#pragma once

#include <array>
#include <cstddef>

#include "engine/io/image/srgb.h"

namespace ptc {

/// Linear values of the integers from 0 to Most, of which Most is white.
template <std::size_t Most>
const std::array<float, Most + 1>& srgb_curve() {
  static const auto kCurve = [] {
    std::array<float, Most + 1> curve;
    for (std::size_t i = 0; i <= Most; ++i) {
      curve[i] =
          static_cast<float>(srgb_to_linear(static_cast<double>(i) / static_cast<double>(Most)));
    }
    return curve;
  }();
  return kCurve;
}

}  // namespace ptc
