// Small number types as they lie in a file (spec/README.md#types): no I/O, no state.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace ptc {

namespace detail {

/// The unit vector of a point on the square [-1, 1]^2 of a folded octahedron.
[[nodiscard]] inline std::array<float, 3> unfold_octahedron(float u, float v) noexcept {
  float x = u;
  float y = v;
  const float z = 1 - std::abs(u) - std::abs(v);
  if (z < 0) {
    x = std::copysign(1 - std::abs(v), u);
    y = std::copysign(1 - std::abs(u), v);
  }
  const float length = std::sqrt(x * x + y * y + z * z);
  return {x / length, y / length, z / length};
}

}  // namespace detail

/// IEEE 754 binary16 nearest to x (ties to even); beyond 65504 it saturates there, NaN gives 0.
[[nodiscard]] std::uint16_t encode_half(float x) noexcept;
/// The value of a pattern, infinities and NaN included.
[[nodiscard]] inline float decode_half(std::uint16_t bits) noexcept {
  const std::uint32_t sign = static_cast<std::uint32_t>(bits & 0x8000) << 16;
  const std::uint32_t magnitude = bits & 0x7fff;
  if (magnitude >= 0x7c00) {  // infinity and NaN keep their fraction
    return std::bit_cast<float>(sign | 0x7f800000 | (magnitude & 0x3ff) << 13);
  }
  // Shifted into place the exponent is 112 too small; the product is exact, also for subnormals.
  const float value = std::bit_cast<float>(magnitude << 13) * 0x1p112f;
  return std::bit_cast<float>(sign | std::bit_cast<std::uint32_t>(value));
}

/// Bits 30..15 of a non-negative float: full exponent range, 8 bits of fraction. The value that
/// comes back is at least x and at most x (1 + 2^-8), from 2^-126 to the greatest such number,
/// 3.39e38; what is greater becomes it. Negative numbers and NaN give 0.
[[nodiscard]] std::uint16_t encode_ufloat16_up(float x) noexcept;
/// The nearest such number: relative error at most 2^-9.
[[nodiscard]] std::uint16_t encode_ufloat16(float x) noexcept;
[[nodiscard]] inline float decode_ufloat16(std::uint16_t bits) noexcept {
  return std::bit_cast<float>(std::uint32_t{bits} << 15);
}

/// Three non-negative numbers sharing one exponent, 8 bits each (Ward 1991, "Real Pixels"):
/// r | g << 8 | b << 16 | (exponent + 128) << 24. Error at most max(r, g, b) / 256.
[[nodiscard]] std::uint32_t encode_rgbe(const std::array<float, 3>& rgb) noexcept;
[[nodiscard]] std::array<float, 3> decode_rgbe(std::uint32_t bits) noexcept;

/// A unit vector folded onto the octahedron, two signed 16-bit numbers (Cigolle et al. 2014);
/// angle error at most 1e-4 rad. The zero vector encodes as +z.
[[nodiscard]] std::array<std::int16_t, 2> encode_octahedral(const std::array<float, 3>& n) noexcept;
[[nodiscard]] inline std::array<float, 3> decode_octahedral(std::int16_t u,
                                                            std::int16_t v) noexcept {
  return detail::unfold_octahedron(static_cast<float>(std::max<int>(u, -32767)) / 32767,
                                   static_cast<float>(std::max<int>(v, -32767)) / 32767);
}
/// The same in two bytes, u | v << 8 as signed bytes; angle error at most 0.017 rad.
[[nodiscard]] std::uint16_t encode_octahedral8(const std::array<float, 3>& n) noexcept;
[[nodiscard]] std::array<float, 3> decode_octahedral8(std::uint16_t bits) noexcept;

}  // namespace ptc
