// The Z-curve, compared with interleaving bit by bit.
#include "format/morton.h"

#include <algorithm>
#include <vector>

#include <catch2/catch.hpp>

#include "format/point_record.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::Random;

namespace {

// Encodes digit by digit, as the specification says it.
MortonKey interleave(const LatticePoint& p) {
  MortonKey key;
  for (int level = 1; level <= kLatticeBits; ++level) {
    std::uint64_t& half = level <= 21 ? key.high : key.low;
    const int bit = kLatticeBits - level;
    half = half << 3 | (p[2] >> bit & 1) << 2 | (p[1] >> bit & 1) << 1 | (p[0] >> bit & 1);
  }
  return key;
}

LatticePoint random_point(Random& random) {
  LatticePoint p;
  const std::uint64_t mask = kLatticeMax >> random.below(43);
  for (auto& coordinate : p) coordinate = random.bits() & mask;
  return p;
}

}  // namespace

TEST_CASE("morton: keys interleave z y x and decode to the same point", "[format][morton]") {
  Random random(1);
  unsigned wrong = 0;
  for (int i = 0; i < 100000; ++i) {
    const LatticePoint p = random_point(random);
    const MortonKey key = encode_morton(p);
    wrong += key != interleave(p) || decode_morton(key) != p;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (int bit = 0; bit < kLatticeBits; ++bit) {
      LatticePoint p{};
      p[axis] = std::uint64_t{1} << bit;
      wrong += encode_morton(p) != interleave(p) || decode_morton(encode_morton(p)) != p;
    }
  }
  CHECK(wrong == 0);
  const MortonKey last = encode_morton({kLatticeMax, kLatticeMax, kLatticeMax});
  CHECK(last == MortonKey{0x7fffffffffffffff, 0x7fffffffffffffff});
}

TEST_CASE("morton: blocks of keys are decoded the same by every instruction set",
          "[format][morton]") {
  Random random(3);
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{7}, kPositionBlock}) {
    std::vector<PointRecord> points(count);
    for (PointRecord& point : points) point.key = encode_morton(random_point(random));
    for (const InstructionSet set : kInstructionSets) {
      if (!has_instructions(set)) continue;
      PositionBlock positions{};
      decode_positions(points, positions, set);
      for (std::size_t i = 0; i < count; ++i) {
        const LatticePoint p = decode_morton(points[i].key);
        CHECK((positions[0][i] == p[0] && positions[1][i] == p[1] && positions[2][i] == p[2]));
      }
    }
  }
}

TEST_CASE("morton: levels, digits and cells agree with a digit-by-digit computation",
          "[format][morton]") {
  Random random(2);
  unsigned wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const MortonKey a = interleave(random_point(random));
    MortonKey b = a;  // differs from a from some level on
    const int from = static_cast<int>(random.below(43)) + 1;
    for (int level = from; level <= kLatticeBits; ++level) {
      const std::uint64_t digit = level == from ? 1 + random.below(7) : random.below(8);
      (level <= 21 ? b.high : b.low) ^= digit << (3 * (level <= 21 ? 21 - level : 42 - level));
    }
    wrong += common_level(a, b) != from - 1 || common_level(b, a) != from - 1;
    wrong += common_level(a, a) != kLatticeBits;
    MortonKey cell;
    for (int level = 0; level <= kLatticeBits; ++level) {
      if (level > 0) {
        const int shift = 3 * (level <= 21 ? 21 - level : 42 - level);
        const std::uint64_t digit = (level <= 21 ? a.high : a.low) >> shift & 7;
        wrong += octant(a, level) != static_cast<int>(digit);
        (level <= 21 ? cell.high : cell.low) |= digit << shift;
      }
      wrong += cell_of(a, level) != cell;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("morton: keys order cells before the points in them", "[format][morton]") {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const MortonKey a = encode_morton(random_point(random));
    const MortonKey b = encode_morton(random_point(random));
    const int shared = common_level(a, b);
    REQUIRE(cell_of(a, shared) == cell_of(b, shared));
    REQUIRE(cell_of(a, shared) <= std::min(a, b));
    if (a != b) REQUIRE((a < b) == (octant(a, shared + 1) < octant(b, shared + 1)));
  }
}
