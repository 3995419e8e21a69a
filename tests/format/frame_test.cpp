// The lattice over a scene: which points it holds, and which values it keeps exactly.
#include <cmath>
#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "format/morton.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::Random;
using Box = std::array<double, 3>;

namespace {

bool power_of_two(double x) {
  int exponent;
  return std::frexp(x, &exponent) == 0.5;
}

// Checks every rule of spec/morton.md#frame.
void check_frame(const Box& low, const Box& high) {
  const Frame frame = frame_around(low, high);
  INFO("edge " << frame.edge << " origin " << frame.origin[0] << " " << frame.origin[1]);
  REQUIRE(power_of_two(frame.edge));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    REQUIRE(std::fmod(frame.origin[axis], frame.unit()) == 0);
    REQUIRE(frame.origin[axis] <= low[axis]);
    REQUIRE(std::abs(frame.origin[axis]) <= 0x1p53 * frame.unit());
    REQUIRE(std::abs(frame.origin[axis] + frame.edge) <= 0x1p53 * frame.unit());
  }
  for (const Box& corner : {low, high}) {
    const Box back = frame.to_position(frame.to_lattice(corner));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      REQUIRE(std::abs(back[axis] - corner[axis]) <= frame.unit() / 2);
    }
  }
}

}  // namespace

TEST_CASE("frame: boxes of any size and place are kept to within half a unit", "[format][frame]") {
  Random random(1);
  for (int i = 0; i < 20000; ++i) {
    Box low;
    Box high;
    const double scale = std::exp2(random.between(-300, 300));
    const double extent = scale * std::exp2(random.between(-60, 60)) * (i % 5 == 0 ? 0 : 1);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = scale * random.between(-1, 1);
      high[axis] = low[axis] + extent * random.unit();
    }
    check_frame(low, high);
  }
}

TEST_CASE("frame: every lattice point maps to a double and back", "[format][frame]") {
  Random random(2);
  unsigned wrong = 0;
  for (int i = 0; i < 3000; ++i) {
    Box low;
    Box high;
    const double place = i % 3 == 0 ? 0 : std::exp2(random.between(-30, 60));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = place * random.between(-1, 1);
      high[axis] = low[axis] + std::exp2(random.between(-40, 20));
    }
    const Frame frame = frame_around(low, high);
    for (int k = 0; k < 20; ++k) {
      LatticePoint q;
      for (auto& c : q) c = k == 0 ? kLatticeMax : k == 1 ? 0 : random.bits() & kLatticeMax;
      const Box p = frame.to_position(q);
      wrong += frame.to_lattice(p) != q;
      for (std::size_t axis = 0; axis < 3; ++axis) {  // no rounding: the step can be taken back
        const double steps = p[axis] / frame.unit() - frame.origin[axis] / frame.unit();
        wrong += steps != static_cast<double>(q[axis]);
      }
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("frame: floats above edge / 2^18 are kept exactly", "[format][frame]") {
  Random random(3);
  const Frame frame = frame_around({-3, 0, -1}, {2.5, 1, 4});
  CHECK(frame.edge == 8);
  unsigned wrong = 0;
  for (int i = 0; i < 100000; ++i) {
    Box p;
    for (auto& c : p) {
      const auto x = static_cast<float>(std::exp2(random.between(-15, 0)));
      c = x < 0x1p-15f ? 0x1p-15f : x;
    }
    wrong += frame.to_position(frame.to_lattice(p)) != p;
  }
  CHECK(wrong == 0);
}

TEST_CASE("frame: the edge is the smallest that fits", "[format][frame]") {
  CHECK(frame_around({0, 0, 0}, {0.75, 0, 0}).edge == 1);
  // The far corner lies on the face of the unit cube, where no lattice point is.
  CHECK(frame_around({0, 0, 0}, {1, 1, 1}).edge == 2);
  CHECK(frame_around({-1, -1, -1}, {0.999, 0.999, 0.999}).edge == 2);
  CHECK(frame_around({0, 0, 0}, {0, 0, 0}).edge == 1);
}

TEST_CASE("frame: a lone point far out is kept to much less than a millimetre", "[format][frame]") {
  const Box p{1e7 + 0.1234567, -1e7 - 0.7654321, 12.5};
  const Frame frame = frame_around(p, p);
  const Box back = frame.to_position(frame.to_lattice(p));
  for (std::size_t axis = 0; axis < 3; ++axis) CHECK(std::abs(back[axis] - p[axis]) < 1e-8);
  check_frame(p, p);
  check_frame({5e-324, 0, 0}, {5e-324, 0, 0});
  check_frame({-0x1p999, 0, 0}, {0x1p999, 0, 1});
}

TEST_CASE("frame: points outside the cube go to its faces", "[format][frame]") {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Frame frame = frame_around({0, 0, 0}, {0.5, 0.5, 0.5});
  CHECK(frame.to_lattice({-1, 7, 0}) == LatticePoint{0, kLatticeMax, 0});
  CHECK(frame.to_lattice({-kInfinity, kInfinity, 1e300}) ==
        LatticePoint{0, kLatticeMax, kLatticeMax});
  CHECK(frame.to_lattice({frame.edge, 0, 0})[0] == kLatticeMax);
}

TEST_CASE("frame: to_lattice keeps the order of coordinates", "[format][frame]") {
  Random random(4);
  const Frame frame = frame_around({1e6, 1e6, 1e6}, {1e6 + 1, 1e6 + 1, 1e6 + 1});
  double x = 1e6;
  std::uint64_t last = 0;
  unsigned wrong = 0;
  for (int i = 0; i < 200000; ++i) {
    const std::uint64_t q = frame.to_lattice({x, 1e6, 1e6})[0];
    wrong += q < last;
    last = q;
    x += 5e-6 * random.unit();
  }
  CHECK(wrong == 0);
}

TEST_CASE("frame: bounds that are not a box are refused", "[format][frame]") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(frame_around({1, 0, 0}, {0, 0, 0}), std::invalid_argument);
  CHECK_THROWS_AS(frame_around({0, kNan, 0}, {0, 0, 0}), std::invalid_argument);
  CHECK_THROWS_AS(frame_around({0, 0, 0}, {0, 0, kNan}), std::invalid_argument);
  CHECK_THROWS_AS(frame_around({0, 0, 0}, {kInfinity, 0, 0}), std::invalid_argument);
  CHECK_THROWS_AS(frame_around({-kInfinity, 0, 0}, {0, 0, 0}), std::invalid_argument);
  CHECK_THROWS_AS(frame_around({-0x1p1000, 0, 0}, {0x1p1000, 0, 0}), std::invalid_argument);
  CHECK_THROWS_AS(frame_around({0x1p1001, 0, 0}, {0x1p1001, 0, 0}), std::invalid_argument);
}
