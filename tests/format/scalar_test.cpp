// Small number types, compared with the rules that define them.
#include "format/scalar.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tests/format/support.h"

using namespace ptc;
using ptc::test::Random;

namespace {

// Returns the value of a binary16 pattern by its definition.
double half_value(unsigned bits) {
  const int exponent = static_cast<int>(bits >> 10 & 31);
  const double fraction = bits & 1023;
  const double magnitude =
      exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1024 + fraction, exponent - 25);
  return (bits & 0x8000) != 0 ? -magnitude : magnitude;
}

double angle(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  double dot = 0;
  double a2 = 0;
  double b2 = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    dot += double{a[i]} * b[i];
    a2 += double{a[i]} * a[i];
    b2 += double{b[i]} * b[i];
  }
  return std::acos(std::min(1.0, dot / std::sqrt(a2 * b2)));
}

std::array<float, 3> random_direction(Random& random) {
  const double z = random.between(-1, 1);
  const double phi = random.between(0, 6.283185307179586);
  const double r = std::sqrt(1 - z * z);
  return {static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)),
          static_cast<float>(z)};
}

}  // namespace

TEST_CASE("half: every finite pattern decodes to its value and encodes back", "[format][scalar]") {
  unsigned wrong = 0;
  for (unsigned bits = 0; bits < 0x10000; ++bits) {
    if ((bits & 0x7c00) == 0x7c00) continue;
    const float value = decode_half(static_cast<std::uint16_t>(bits));
    wrong += double{value} != half_value(bits) || std::signbit(value) != (bits >= 0x8000) ||
             encode_half(value) != bits;
  }
  CHECK(wrong == 0);
}

TEST_CASE("half: infinities and NaN decode as such, and encoding saturates", "[format][scalar]") {
  unsigned wrong = 0;
  for (unsigned fraction = 1; fraction < 1024; ++fraction) {
    wrong += !std::isnan(decode_half(static_cast<std::uint16_t>(0x7c00 | fraction)));
    wrong += !std::isnan(decode_half(static_cast<std::uint16_t>(0xfc00 | fraction)));
  }
  CHECK(wrong == 0);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  CHECK(decode_half(0x7c00) == kInfinity);
  CHECK(decode_half(0xfc00) == -kInfinity);
  CHECK(encode_half(kInfinity) == 0x7bff);
  CHECK(encode_half(-kInfinity) == 0xfbff);
  CHECK(encode_half(65504.0f) == 0x7bff);
  CHECK(encode_half(std::nextafter(65504.0f, 0.0f)) == 0x7bff);
  CHECK(encode_half(65520.0f) == 0x7bff);
  CHECK(encode_half(std::numeric_limits<float>::quiet_NaN()) == 0);
  CHECK(encode_half(-std::numeric_limits<float>::quiet_NaN()) == 0);
}

TEST_CASE("half: between neighbours the nearest wins, ties go to even", "[format][scalar]") {
  unsigned wrong = 0;
  for (unsigned bits = 0; bits < 0x7bff; ++bits) {
    // The middle of two neighbours has one bit more than a half: it is a float.
    const auto middle = static_cast<float>((half_value(bits) + half_value(bits + 1)) / 2);
    for (const unsigned sign : {0u, 0x8000u}) {
      const float side = sign == 0 ? 1.0f : -1.0f;
      const unsigned even = bits + (bits & 1);
      wrong += encode_half(side * middle) != (sign | even);
      wrong += encode_half(side * std::nextafter(middle, 0.0f)) != (sign | bits);
      wrong += encode_half(side * std::nextafter(middle, 1e9f)) != (sign | (bits + 1));
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("ufloat16: a value rounded up is an upper bound within 2^-8", "[format][scalar]") {
  Random random(1);
  unsigned wrong = 0;
  const auto check = [&](float x) {
    const float up = decode_ufloat16(encode_ufloat16_up(x));
    wrong += !(up >= x) || !(double{up} <= double{x} * (1 + 0x1p-8));
    const float near = decode_ufloat16(encode_ufloat16(x));
    wrong += std::abs(double{near} - x) > double{x} * 0x1p-9;
  };
  for (int i = 0; i < 1000000; ++i) {  // every normal exponent and fraction equally often
    check(std::bit_cast<float>(
        static_cast<std::uint32_t>(0x00800000 + random.below(0x7f7f8000 - 0x00800000))));
  }
  for (std::uint32_t bits = 0x0100; bits <= 0xfeff; ++bits) {
    const float exact = decode_ufloat16(static_cast<std::uint16_t>(bits));
    wrong += encode_ufloat16_up(exact) != bits || encode_ufloat16(exact) != bits;
    check(exact);
    if (bits > 0x0100) check(std::nextafter(exact, 0.0f));
    if (bits < 0xfeff) check(std::nextafter(exact, 3e38f));
  }
  CHECK(wrong == 0);
}

TEST_CASE("ufloat16: the nearest wins, ties go to even", "[format][scalar]") {
  unsigned wrong = 0;
  for (std::uint32_t bits = 0; bits < 0xfeff; ++bits) {
    const float middle = std::bit_cast<float>(bits << 15 | 0x4000);
    wrong += encode_ufloat16(middle) != bits + (bits & 1);
    wrong += encode_ufloat16(std::bit_cast<float>(bits << 15 | 0x3fff)) != bits;
    wrong += encode_ufloat16(std::bit_cast<float>(bits << 15 | 0x4001)) != bits + 1;
  }
  CHECK(wrong == 0);
}

TEST_CASE("ufloat16: small numbers stay bounded, large ones stay finite", "[format][scalar]") {
  CHECK(encode_ufloat16_up(0) == 0);
  CHECK(encode_ufloat16(0) == 0);
  CHECK(encode_ufloat16_up(-1) == 0);
  CHECK(encode_ufloat16_up(std::numeric_limits<float>::denorm_min()) == 1);
  CHECK(encode_ufloat16_up(std::numeric_limits<float>::quiet_NaN()) == 0);
  CHECK(encode_ufloat16_up(std::numeric_limits<float>::max()) == 0xfeff);
  CHECK(encode_ufloat16(std::numeric_limits<float>::infinity()) == 0xfeff);
  CHECK(std::isfinite(decode_ufloat16(0xfeff)));
}

TEST_CASE("rgbe: the error is at most the largest component / 256", "[format][scalar]") {
  Random random(2);
  unsigned wrong = 0;
  for (int i = 0; i < 300000; ++i) {
    const double scale = std::exp2(random.between(-118, 126.9));
    std::array<float, 3> rgb;
    for (float& c : rgb) c = static_cast<float>(scale * random.unit());
    if (i % 4 == 0)
      rgb[random.below(3)] = static_cast<float>(scale * (1 - 0x1p-20 * random.unit()));
    const float greatest = std::max({rgb[0], rgb[1], rgb[2]});
    const std::array<float, 3> back = decode_rgbe(encode_rgbe(rgb));
    for (std::size_t k = 0; k < 3; ++k) {
      wrong += !(std::abs(double{back[k]} - rgb[k]) <= double{greatest} / 256);
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("rgbe: every exponent and mantissa decodes to a finite number that encodes back",
          "[format][scalar]") {
  unsigned wrong = 0;
  for (unsigned exponent = 0; exponent < 256; ++exponent) {
    for (unsigned mantissa = 0; mantissa < 256; ++mantissa) {
      const std::array<float, 3> rgb = decode_rgbe(mantissa | 7u << 8 | exponent << 24);
      wrong += !std::isfinite(rgb[0]);
      wrong += double{rgb[0]} != std::ldexp(mantissa, static_cast<int>(exponent) - 136);
      // A normalised pattern is the only one that the encoder gives for its value.
      if (mantissa >= 128) wrong += encode_rgbe(rgb) != (mantissa | 7u << 8 | exponent << 24);
    }
  }
  CHECK(wrong == 0);
  CHECK(encode_rgbe({0, 0, 0}) == 0);
  CHECK(encode_rgbe({-1, std::numeric_limits<float>::quiet_NaN(), 0}) == 0);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  CHECK(encode_rgbe({kInfinity, 0, 1}) == (0xff000000u | 255));
  CHECK(encode_rgbe({std::numeric_limits<float>::max(), 0, 0}) == (0xff000000u | 255));
}

TEST_CASE("octahedral: 16 bits keep a direction to 1e-4 rad", "[format][scalar]") {
  Random random(3);
  double worst = 0;
  for (int i = 0; i < 200000; ++i) {
    const std::array<float, 3> n = random_direction(random);
    const auto [u, v] = encode_octahedral(n);
    worst = std::max(worst, angle(n, decode_octahedral(u, v)));
  }
  CHECK(worst <= 1e-4);
}

TEST_CASE("octahedral: 8 bits keep a direction to 0.017 rad", "[format][scalar]") {
  Random random(4);
  double worst = 0;
  for (int i = 0; i < 1000000; ++i) {
    const std::array<float, 3> n = random_direction(random);
    worst = std::max(worst, angle(n, decode_octahedral8(encode_octahedral8(n))));
  }
  CHECK(worst <= 0.017);
}

TEST_CASE("octahedral: every pattern decodes to a unit vector, and axes are exact",
          "[format][scalar]") {
  unsigned wrong = 0;
  for (unsigned bits = 0; bits < 0x10000; ++bits) {
    const auto n = decode_octahedral8(static_cast<std::uint16_t>(bits));
    wrong += !(std::abs(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-5f);
    const auto high = static_cast<std::int16_t>(bits);
    for (const int other : {-32768, -32767, -20000, 0, 12767, 32767}) {
      const auto m = decode_octahedral(high, static_cast<std::int16_t>(other));
      wrong += !(std::abs(m[0] * m[0] + m[1] * m[1] + m[2] * m[2] - 1) < 1e-5f);
    }
  }
  CHECK(wrong == 0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const float sign : {1.0f, -1.0f}) {
      std::array<float, 3> n{};
      n[axis] = sign;
      const auto [u, v] = encode_octahedral(n);
      CHECK(decode_octahedral(u, v) == n);
      CHECK(decode_octahedral8(encode_octahedral8(n)) == n);
    }
  }
  const std::array<float, 3> up{0, 0, 1};
  CHECK(encode_octahedral({0, 0, 0}) == encode_octahedral(up));
  CHECK(encode_octahedral8({0, 0, 0}) == encode_octahedral8(up));
}

TEST_CASE("octahedral: decoding is the nearest rounding of integers, as the spec defines it",
          "[format][scalar]") {
  unsigned wrong = 0;
  const auto check = [&](int u, int v, int q, const std::array<double, 3>& n) {
    // The equations of spec/README.md#types.
    int a = std::max(u, -q), b = std::max(v, -q);
    const int c = q - std::abs(a) - std::abs(b);
    if (c < 0) {
      const int old_a = a, old_b = b;
      a = (q - std::abs(old_b)) * (old_a < 0 ? -1 : 1);
      b = (q - std::abs(old_a)) * (old_b < 0 ? -1 : 1);
    }
    const std::int64_t sum = std::int64_t{a} * a + std::int64_t{b} * b + std::int64_t{c} * c;
    const double length = std::sqrt(static_cast<double>(sum));
    wrong += n != std::array{a / length, b / length, c / length};
  };
  constexpr std::array kEdges{-32768, -32767, -32766, -16384, -16383, -1,
                              0,      1,      16383,  16384,  32766,  32767};
  for (int u = -32768; u < 32768; ++u) {
    for (const int v : kEdges) {
      const auto su = static_cast<std::int16_t>(u), sv = static_cast<std::int16_t>(v);
      check(u, v, 32767, decode_octahedral_f64(su, sv));
      check(v, u, 32767, decode_octahedral_f64(sv, su));
    }
  }
  CHECK(wrong == 0);
  for (unsigned bits = 0; bits < 0x10000; ++bits) {
    const int u = static_cast<std::int8_t>(bits & 0xff), v = static_cast<std::int8_t>(bits >> 8);
    const std::array<double, 3> exact = detail::unfold_octahedron(u, v, 127);
    check(u, v, 127, exact);
    const std::array<float, 3> stored = decode_octahedral8(static_cast<std::uint16_t>(bits));
    for (std::size_t k = 0; k < 3; ++k) wrong += stored[k] != static_cast<float>(exact[k]);
  }
  CHECK(wrong == 0);
}

TEST_CASE("octahedral: on the fold a direction lies in the plane of the walls",
          "[format][scalar]") {
  unsigned wrong = 0;
  for (int u = -32767; u <= 32767; ++u) {
    for (const int sign : {-1, 1}) {
      const auto v = static_cast<std::int16_t>(sign * (32767 - std::abs(u)));
      const auto n = decode_octahedral_f64(static_cast<std::int16_t>(u), v);
      wrong += n[2] != 0 || std::signbit(n[2]);
      // A step outside of the fold looks down, a step inside up.
      const auto beyond = static_cast<std::int16_t>(v + (v < 0 ? -1 : 1));
      const auto within = static_cast<std::int16_t>(v - (v < 0 ? -1 : 1));
      wrong += !(decode_octahedral_f64(static_cast<std::int16_t>(u), beyond)[2] < 0) &&
               std::abs(u) != 0;  // -32768 stands for -32767
      wrong += v != 0 && !(decode_octahedral_f64(static_cast<std::int16_t>(u), within)[2] > 0);
    }
  }
  CHECK(wrong == 0);
}
