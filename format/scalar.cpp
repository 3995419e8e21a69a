// Small number types (spec/README.md#types). Only operations that IEEE 754 rounds exactly are used,
// so every machine gives the same bits.
#include "format/scalar.h"

#include <algorithm>
#include <cmath>

namespace ptc {
namespace {

constexpr std::uint16_t kMaxUfloat16 = 0xfeff;  // exponent 255 stands for infinity and NaN

// Returns the nearest integer, halves away from zero. It is exact for the magnitudes used here.
int nearest(float x) noexcept {
  return static_cast<int>(x < 0 ? x - 0.5f : x + 0.5f);
}

// Returns the point on the square [-1, 1]^2 that stands for a direction. The upper half of the
// octahedron lies in the diamond in the middle, the lower half is folded out over the edges of the
// diamond.
//
//      +---^---+
//      | / | \ |    inside the diamond z >= 0, outside z < 0
//      |<--+-->|
//      | \ | / |
//      +---v---+
std::array<float, 2> fold(const std::array<float, 3>& n) noexcept {
  const float norm = std::abs(n[0]) + std::abs(n[1]) + std::abs(n[2]);
  if (!(norm > 0) || !std::isfinite(norm)) return {0, 0};
  const float u = n[0] / norm;
  const float v = n[1] / norm;
  if (n[2] >= 0) return {u, v};
  return {std::copysign(1 - std::abs(v), u), std::copysign(1 - std::abs(u), v)};
}

}  // namespace

std::uint16_t encode_half(float x) noexcept {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(x);
  const auto sign = static_cast<std::uint32_t>(bits >> 16 & 0x8000);
  const std::uint32_t magnitude = bits & 0x7fffffff;
  if (magnitude > 0x7f800000) return 0;                                           // NaN
  if (magnitude >= 0x477fe000) return static_cast<std::uint16_t>(sign | 0x7bff);  // 65504 and above
  std::uint32_t rounded;
  if (magnitude >= 0x38800000) {  // normal, from 2^-14 on: rounding may carry into the exponent
    const std::uint32_t rebased = magnitude - (112u << 23);
    rounded = (rebased + 0xfff + (rebased >> 13 & 1)) >> 13;
  } else {  // subnormal: adding 2^-1 leaves x in units of 2^-24 in the low bits, rounded to even
    const float shifted = std::bit_cast<float>(magnitude) + 0.5f;
    rounded = std::bit_cast<std::uint32_t>(shifted) - std::bit_cast<std::uint32_t>(0.5f);
  }
  return static_cast<std::uint16_t>(sign | rounded);
}

std::uint16_t encode_ufloat16_up(float x) noexcept {
  if (!(x > 0)) return 0;
  const std::uint32_t rounded = (std::bit_cast<std::uint32_t>(x) + 0x7fff) >> 15;
  return static_cast<std::uint16_t>(std::min<std::uint32_t>(rounded, kMaxUfloat16));
}

std::uint16_t encode_ufloat16(float x) noexcept {
  if (!(x > 0)) return 0;
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(x);
  const std::uint32_t rounded = (bits + 0x3fff + (bits >> 15 & 1)) >> 15;
  return static_cast<std::uint16_t>(std::min<std::uint32_t>(rounded, kMaxUfloat16));
}

std::uint32_t encode_rgbe(const std::array<float, 3>& rgb) noexcept {
  const float greatest = std::max({rgb[0], rgb[1], rgb[2], 0.0f});
  if (!(greatest > 0)) return 0;
  // Find the exponent e with greatest in [2^(e-1), 2^e), clamped to [-128, 127].
  const double wide = greatest;
  const int biased = static_cast<int>(std::bit_cast<std::uint64_t>(wide) >> 52) - 1022;
  const int exponent = std::clamp(biased, -128, 127);
  const double scale = std::bit_cast<double>(static_cast<std::uint64_t>(1023 + 8 - exponent) << 52);
  std::uint32_t bits = static_cast<std::uint32_t>(exponent + 128) << 24;
  for (unsigned i = 0; i < 3; ++i) {
    const double scaled = std::max(0.0, static_cast<double>(rgb[i])) * scale + 0.5;
    bits |= static_cast<std::uint32_t>(std::min(scaled, 255.0)) << (8 * i);
  }
  return bits;
}

std::array<float, 3> decode_rgbe(std::uint32_t bits) noexcept {
  const auto exponent = static_cast<std::uint64_t>(bits >> 24);
  const double scale = std::bit_cast<double>((exponent + 1023 - 136) << 52);
  return {static_cast<float>((bits & 0xff) * scale), static_cast<float>((bits >> 8 & 0xff) * scale),
          static_cast<float>((bits >> 16 & 0xff) * scale)};
}

std::array<std::int16_t, 2> encode_octahedral(const std::array<float, 3>& n) noexcept {
  const auto [u, v] = fold(n);
  return {static_cast<std::int16_t>(nearest(u * 32767)),
          static_cast<std::int16_t>(nearest(v * 32767))};
}

std::uint16_t encode_octahedral8(const std::array<float, 3>& n) noexcept {
  const auto [u, v] = fold(n);
  return static_cast<std::uint16_t>((nearest(u * 127) & 0xff) | (nearest(v * 127) & 0xff) << 8);
}

std::array<float, 3> decode_octahedral8(std::uint16_t bits) noexcept {
  return detail::to_floats(detail::unfold_octahedron(static_cast<std::int8_t>(bits & 0xff),
                                                     static_cast<std::int8_t>(bits >> 8), 127));
}

}  // namespace ptc
