// Small number types as they lie in a file (spec/README.md#types): no I/O, no state.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace ptc {

/// IEEE 754 binary16 nearest to x (ties to even); beyond 65504 it saturates there, NaN gives 0.
[[nodiscard]] std::uint16_t encode_half(float x) noexcept;
/// The value of a pattern, infinities and NaN included.
[[nodiscard]] float decode_half(std::uint16_t bits) noexcept;

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
[[nodiscard]] std::array<float, 3> decode_octahedral(std::int16_t u, std::int16_t v) noexcept;
/// The same in two bytes, u | v << 8 as signed bytes; angle error at most 0.017 rad.
[[nodiscard]] std::uint16_t encode_octahedral8(const std::array<float, 3>& n) noexcept;
[[nodiscard]] std::array<float, 3> decode_octahedral8(std::uint16_t bits) noexcept;

}  // namespace ptc
