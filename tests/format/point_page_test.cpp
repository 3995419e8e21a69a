// Point pages: columns survive encoding, and verify() finds what a plain loop over the points
// finds.
#include "format/point_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "format/scalar.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::put;
using ptc::test::Random;
using Bytes = std::vector<std::byte>;

namespace {

std::vector<PointRecord> random_points(std::size_t count, std::uint64_t spread,
                                       std::uint64_t seed) {
  Random random(seed);
  std::vector<PointRecord> points(count);
  LatticePoint base;
  for (auto& c : base) c = random.below(kLatticeMax - std::min(spread, kLatticeMax) + 1);
  for (PointRecord& p : points) {
    LatticePoint q = base;
    for (auto& c : q) c = std::min(c + random.below(spread + 1), kLatticeMax);
    p.key = encode_morton(q);
    p.radius = static_cast<float>(random.between(0, 10));
    for (auto& n : p.normal) n = static_cast<std::int16_t>(random.bits());
    for (auto& r : p.radiance) r = static_cast<std::uint16_t>(random.below(0x7c00));
    for (auto& a : p.albedo) a = static_cast<std::uint8_t>(random.bits());
    for (auto& e : p.emission) e = static_cast<std::uint16_t>(random.below(0x7c00));
  }
  std::ranges::sort(points, {}, &PointRecord::key);
  return points;
}

// Says whether two points are equal, but for emission where pages do not have it.
bool same(const PointRecord& a, const PointRecord& b, std::uint8_t point_bytes) {
  const Half3 expected = point_bytes == kPointBytes ? Half3{} : b.emission;
  return a.key == b.key && a.radius == b.radius && a.normal == b.normal &&
         a.radiance == b.radiance && a.albedo == b.albedo && a.flags == b.flags &&
         a.emission == expected;
}

std::string verify_clause(const Bytes& payload, std::uint32_t count,
                          std::uint8_t point_bytes = kPointBytes) {
  return clause_of([&] { PointPage(payload, count, point_bytes).verify(); });
}

// Checks the rules one point at a time, on decoded values.
bool valid(const Bytes& payload, std::uint32_t count, std::uint8_t point_bytes) {
  for (std::uint32_t i = 0; i < count; ++i) {
    if (test::get<std::uint32_t>(payload, 12 * count + 4 * i) >> 30 != 0) return false;
  }
  const PointPage page(payload, count, point_bytes);
  for (std::uint32_t i = 0; i < count; ++i) {
    const PointRecord p = page[i];
    if (i > 0 && p.key < page[i - 1].key) return false;
    if (!std::isfinite(p.radius) || std::signbit(p.radius) || p.flags != 0) return false;
    for (const Half3& light : {p.radiance, p.emission}) {
      for (const std::uint16_t half : light) {
        if (!std::isfinite(decode_half(half)) || (half & 0x8000) != 0) return false;
      }
    }
  }
  return true;
}

}  // namespace

TEST_CASE("point page: points survive encoding and decoding, whatever their spread",
          "[format][points]") {
  for (const std::uint8_t point_bytes : {kPointBytes, kEmittingPointBytes}) {
    for (int bits = 0; bits <= kLatticeBits; ++bits) {
      const auto points = random_points(112, (1ull << bits) - 1, static_cast<std::uint64_t>(bits));
      const Bytes payload = encode_point_page(points, point_bytes);
      const PointPage page(payload, 112, point_bytes);
      REQUIRE(payload.size() == std::size_t{112} * point_bytes);
      CHECK(page.emits() == (point_bytes == 40));
      CHECK_NOTHROW(page.verify());
      unsigned wrong = 0;
      for (std::uint32_t i = 0; i < page.size(); ++i) {
        wrong += !same(page[i], points[i], point_bytes);
        wrong += page.position(i) != decode_morton(points[i].key);
        wrong += page.radius(i) != points[i].radius || page.normal(i) != points[i].normal ||
                 page.radiance(i) != points[i].radiance || page.albedo(i) != points[i].albedo ||
                 page.emission(i) != page[i].emission;
      }
      CHECK(wrong == 0);
    }
  }
}

TEST_CASE("point page: columns lie where the spec says", "[format][points]") {
  PointRecord p;
  p.key = encode_morton({0x2ab00000001, 0x15500000002, 0x3ff00000003});
  p.radius = 1.5f;
  p.normal = {-1, 2};
  p.radiance = {1, 2, 3};
  p.albedo = {4, 5, 6};
  p.emission = {7, 8, 9};
  const std::vector<PointRecord> points{p, p};
  const Bytes payload = encode_point_page(points, kPointBytes);
  CHECK(test::get<std::uint32_t>(payload, 0) == 1);
  CHECK(test::get<std::uint32_t>(payload, 8) == 2);
  CHECK(test::get<std::uint32_t>(payload, 16) == 3);
  CHECK(test::get<std::uint32_t>(payload, 24) == (0x2abu | 0x155u << 10 | 0x3ffu << 20));
  CHECK(test::get<float>(payload, 32) == 1.5f);
  CHECK(test::get<std::int16_t>(payload, 40) == -1);
  CHECK(test::get<std::int16_t>(payload, 44) == 2);
  CHECK(test::get<std::uint16_t>(payload, 48) == 1);
  CHECK(test::get<std::uint16_t>(payload, 56) == 3);
  CHECK(payload[60] == std::byte{4});
  CHECK(payload[64] == std::byte{6});
  CHECK(payload[66] == std::byte{0});
  REQUIRE(payload.size() == 68);
  // Emission follows all other columns, which stay where they are.
  const Bytes emitting = encode_point_page(points, kEmittingPointBytes);
  REQUIRE(emitting.size() == 80);
  CHECK(std::ranges::equal(std::span(emitting).first(68), payload));
  CHECK(test::get<std::uint16_t>(emitting, 68) == 7);
  CHECK(test::get<std::uint16_t>(emitting, 70) == 7);
  CHECK(test::get<std::uint16_t>(emitting, 72) == 8);
  CHECK(test::get<std::uint16_t>(emitting, 76) == 9);
}

TEST_CASE("point page: negative zeros are stored as zero", "[format][points]") {
  PointRecord p;
  p.radius = -0.0f;
  p.radiance = {0x8000, 0x8000, 0};
  p.emission = {0x8000, 0, 0x8000};
  for (const std::uint8_t point_bytes : {kPointBytes, kEmittingPointBytes}) {
    CHECK(encode_point_page(std::vector<PointRecord>{p}, point_bytes) == Bytes(point_bytes));
  }
}

TEST_CASE("point page: any other size is refused", "[format][points]") {
  for (const std::uint8_t point_bytes : {kPointBytes, kEmittingPointBytes}) {
    const Bytes payload = encode_point_page(random_points(5, 100, 1), point_bytes);
    const auto clause = [&](std::span<const std::byte> bytes, std::uint32_t count) {
      return clause_of([&] { PointPage page(bytes, count, point_bytes); });
    };
    CHECK(clause(payload, 5) == "none");
    for (const std::uint32_t count : {0u, 4u, 6u, 0xffffffffu}) {
      CHECK(clause(payload, count) == "spec/points.md#point-size");
    }
    for (std::size_t n = 0; n < payload.size(); ++n) {
      CHECK(clause(std::span(payload).first(n), 5) == "spec/points.md#point-size");
    }
    CHECK(clause({}, 0) == "spec/points.md#point-size");
    CHECK_THROWS_AS(encode_point_page({}, point_bytes), std::invalid_argument);
  }
  const Bytes emitting = encode_point_page(random_points(5, 100, 1), kEmittingPointBytes);
  CHECK(clause_of([&] { PointPage page(emitting, 5, kPointBytes); }) ==
        "spec/points.md#point-size");
}

TEST_CASE("point page: any value of any byte is judged as by a loop over the points",
          "[format][points]") {
  for (const std::uint8_t point_bytes : {kPointBytes, kEmittingPointBytes}) {
    unsigned wrong = 0;
    unsigned refused = 0;
    for (const std::uint64_t spread : {std::uint64_t{3}, std::uint64_t{5000}, kLatticeMax}) {
      const auto points = random_points(9, spread, spread);
      const Bytes payload = encode_point_page(points, point_bytes);
      for (std::size_t at = 0; at < payload.size(); ++at) {
        for (unsigned value = 0; value < 256; ++value) {
          Bytes changed = payload;
          changed[at] = static_cast<std::byte>(value);
          const bool accepted = verify_clause(changed, 9, point_bytes) == "none";
          wrong += accepted != valid(changed, 9, point_bytes);
          refused += !accepted;
        }
      }
    }
    CHECK(wrong == 0);
    CHECK(refused > 1000);
  }
}

TEST_CASE("point page: emission that is not finite or negative is refused", "[format][points]") {
  constexpr std::uint32_t kCount = 20;
  const Bytes payload = encode_point_page(random_points(kCount, 5000, 3), kEmittingPointBytes);
  for (unsigned half = 0; half < 0x10000; ++half) {
    Bytes changed = payload;
    const std::size_t at = 34 * kCount + 2 * (half % (3 * kCount));
    put(changed, at, static_cast<std::uint16_t>(half));
    const std::string clause = verify_clause(changed, kCount, kEmittingPointBytes);
    if (clause != (half < 0x7c00 ? "none" : "spec/points.md#point-radiance")) {
      FAIL("pattern " << half << ": " << clause);
    }
  }
}

TEST_CASE("point page: the order of any two points is the order of their keys",
          "[format][points]") {
  Random random(6);
  unsigned wrong = 0;
  for (int i = 0; i < 100000; ++i) {
    LatticePoint a;
    LatticePoint b;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      a[axis] = random.bits() & kLatticeMax;
      b[axis] = a[axis] ^ (random.bits() & (kLatticeMax >> random.below(43)));
      if (random.below(3) == 0) b[axis] = a[axis];
    }
    PointRecord first;
    PointRecord second;
    first.key = std::min(encode_morton(a), encode_morton(b));
    second.key = std::max(encode_morton(a), encode_morton(b));
    Bytes payload = encode_point_page(std::vector<PointRecord>{first, second}, kPointBytes);
    wrong += verify_clause(payload, 2) != "none";
    for (std::size_t column = 0; column < 16; column += 4) {  // swap the two positions
      std::swap_ranges(payload.begin() + static_cast<std::ptrdiff_t>(2 * column),
                       payload.begin() + static_cast<std::ptrdiff_t>(2 * column) + 4,
                       payload.begin() + static_cast<std::ptrdiff_t>(2 * column) + 4);
    }
    wrong += (verify_clause(payload, 2) == "none") != (a == b);
  }
  CHECK(wrong == 0);
}

TEST_CASE("point page: any two neighbours out of order are found", "[format][points]") {
  for (const std::uint64_t spread : {std::uint64_t{200}, kLatticeMax}) {
    const auto points = random_points(300, spread, 8);
    const Bytes payload = encode_point_page(points, kPointBytes);
    unsigned wrong = 0;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      Bytes swapped = payload;
      for (std::size_t column = 0; column < 4; ++column) {
        const std::size_t at = 4 * (column * points.size() + i);
        put(swapped, at, test::get<std::uint32_t>(payload, at + 4));
        put(swapped, at + 4, test::get<std::uint32_t>(payload, at));
      }
      const bool same_place = points[i].key == points[i + 1].key;
      wrong += (verify_clause(swapped, 300) == "none") != same_place;
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("point page: the first bad point is named", "[format][points]") {
  const auto points = random_points(100, 1u << 30, 7);
  const Bytes payload = encode_point_page(points, kEmittingPointBytes);
  const auto text = [&](std::size_t at, auto value) {
    Bytes changed = payload;
    put(changed, at, value);
    try {
      PointPage(changed, 100, kEmittingPointBytes).verify();
    } catch (const FormatError& error) {
      return std::to_string(error.offset()) + " " + error.clause() + " " + error.text();
    }
    return std::string("none");
  };
  CHECK(text(12 * 100 + 4 * 42, 0x40000000u) ==
        "1368 spec/points.md#point-lattice point 42: bits 30 and 31 of high are not zero");
  CHECK(text(16 * 100 + 4 * 99, -1.0f) ==
        "1996 spec/points.md#point-radius point 99: radius is negative or not finite");
  CHECK(text(28 * 100 + 2 * 3, std::uint16_t{0x7c00}) ==
        "2806 spec/points.md#point-radiance point 3: radiance is negative or not finite");
  CHECK(text(38 * 100 + 2 * 7, std::uint16_t{0x8001}) ==
        "3814 spec/points.md#point-radiance point 7: emission is negative or not finite");
  CHECK(text(33 * 100 + 8, std::uint8_t{1}) ==
        "3308 spec/points.md#point-flags point 8: flags are not zero");
  CHECK(text(12 * 100 + 4 * 50, 0x3fffffffu).find("spec/points.md#point-order point 51") !=
        std::string::npos);
}
