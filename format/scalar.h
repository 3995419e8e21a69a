// Small number types of the file format (spec/README.md#types) and their conversions, which give
// the same bits on every machine.
//
//   half        s eeeee ffffffffff         IEEE 754 binary16
//   ufloat16    eeeeeeee ffffffff          bits 30 to 15 of a float that is not negative
//   rgbe        e:8 b:8 g:8 r:8            three numbers with one exponent (Ward 1991)
//   octahedral  two signed numbers of 16 or 8 bits: a direction (Cigolle et al. 2014)
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace ptc {

namespace detail {

/// Returns the unit vector that belongs to a point of the unfolded octahedron, whose corners are at
/// -q and q. The fold is decided in integers, so that walls along the axes, which lie on it, are
/// not folded by chance.
[[nodiscard]] inline std::array<double, 3> unfold_octahedron(int u, int v, int q) noexcept {
  int x = std::max(u, -q), y = std::max(v, -q);
  const int a = std::abs(x), b = std::abs(y), z = q - a - b;
  if (z < 0) {
    x = x < 0 ? b - q : q - b;
    y = y < 0 ? a - q : q - a;
  }
  const double length = std::sqrt(
      static_cast<double>(std::int64_t{x} * x + std::int64_t{y} * y + std::int64_t{z} * z));
  return {x / length, y / length, z / length};
}

/// Returns the floats nearest to three numbers.
[[nodiscard]] inline std::array<float, 3> to_floats(const std::array<double, 3>& v) noexcept {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

}  // namespace detail

/// Returns the IEEE 754 binary16 nearest to x, ties to even. Numbers beyond 65504 in magnitude give
/// 65504 with their sign; NaN gives 0.
[[nodiscard]] std::uint16_t encode_half(float x) noexcept;
/// Returns the value of a half, including infinities and NaN.
[[nodiscard]] inline float decode_half(std::uint16_t bits) noexcept {
  const std::uint32_t sign = static_cast<std::uint32_t>(bits & 0x8000) << 16;
  const std::uint32_t magnitude = bits & 0x7fff;
  if (magnitude >= 0x7c00) {  // infinity and NaN keep their fraction
    return std::bit_cast<float>(sign | 0x7f800000 | (magnitude & 0x3ff) << 13);
  }
  // Once shifted into place, the exponent is 112 too small; the product is exact, even for
  // subnormal numbers.
  const float value = std::bit_cast<float>(magnitude << 13) * 0x1p112f;
  return std::bit_cast<float>(sign | std::bit_cast<std::uint32_t>(value));
}

/// Rounds x up to a ufloat16: bits 30 to 15 of a non-negative float, with its full range of
/// exponents and 8 bits of fraction. For x from 2^-126 to the greatest ufloat16, 3.39e38, the
/// decoded value is at least x and at most x (1 + 2^-8). Greater x gives the greatest ufloat16;
/// negative numbers and NaN give 0.
[[nodiscard]] std::uint16_t encode_ufloat16_up(float x) noexcept;
/// Rounds x to the nearest ufloat16, ties to even, with a relative error of at most 2^-9 in the
/// same range. Greater x gives the greatest ufloat16; negative numbers and NaN give 0.
[[nodiscard]] std::uint16_t encode_ufloat16(float x) noexcept;
/// Returns the value of a ufloat16.
[[nodiscard]] inline float decode_ufloat16(std::uint16_t bits) noexcept {
  return std::bit_cast<float>(std::uint32_t{bits} << 15);
}

/// Encodes three non-negative numbers of 8 bits with a common exponent (Ward 1991, "Real Pixels"):
/// r | g << 8 | b << 16 | (exponent + 128) << 24. The error of each is at most max(r, g, b) / 256;
/// negative numbers give 0.
[[nodiscard]] std::uint32_t encode_rgbe(const std::array<float, 3>& rgb) noexcept;
/// Returns the three numbers of an rgbe.
[[nodiscard]] std::array<float, 3> decode_rgbe(std::uint32_t bits) noexcept;

/// Encodes a direction as a point of the unfolded octahedron, {u, v} with 16 bits each (Cigolle et
/// al. 2014). The angle error is at most 1e-4 rad. The zero vector encodes as +z.
[[nodiscard]] std::array<std::int16_t, 2> encode_octahedral(const std::array<float, 3>& n) noexcept;
/// Returns the unit vector of an octahedral u and v; every pair of numbers has one.
[[nodiscard]] inline std::array<double, 3> decode_octahedral_f64(std::int16_t u,
                                                                 std::int16_t v) noexcept {
  return detail::unfold_octahedron(u, v, 32767);
}
/// Returns the floats nearest to that vector.
[[nodiscard]] inline std::array<float, 3> decode_octahedral(std::int16_t u,
                                                            std::int16_t v) noexcept {
  return detail::to_floats(decode_octahedral_f64(u, v));
}
/// Encodes a direction as a point of the unfolded octahedron in two signed bytes, u | v << 8. The
/// angle error is at most 0.017 rad. The zero vector encodes as +z.
[[nodiscard]] std::uint16_t encode_octahedral8(const std::array<float, 3>& n) noexcept;
/// Returns the unit vector of two octahedral bytes; every pattern has one.
[[nodiscard]] std::array<float, 3> decode_octahedral8(std::uint16_t bits) noexcept;

}  // namespace ptc
