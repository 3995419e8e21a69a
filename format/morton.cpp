// Bit interleaving, and the frame around a box (spec/morton.md).
#include "format/morton.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

namespace ptc {
namespace {

constexpr std::uint64_t kHalfMask = (std::uint64_t{1} << kHalfBits) - 1;
constexpr int kMinExponent = -960;      // the unit of an edge 2^-960, 2^-1002, is a normal double
constexpr double kMaxBound = 0x1p1000;  // keeps origin + edge finite

// Moves bit i to bit 3 i for 21 bits, halving the stride at each step (Morton 1966; steps as in
// Raman and Wise 2008, "Converting to and from Dilated Integers").
std::uint64_t spread(std::uint64_t v) noexcept {
  v = (v | v << 32) & 0x001f00000000ffff;
  v = (v | v << 16) & 0x001f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  v = (v | v << 2) & 0x1249249249249249;
  return v;
}

// Returns a half of a key with all but its first `digits` (0 to 21) octal digits cleared.
std::uint64_t leading_digits(std::uint64_t half, int digits) noexcept {
  return digits == 0 ? 0 : half >> (63 - 3 * digits) << (63 - 3 * digits);
}

// Says whether every multiple of `unit` in the cube over [low, high] is a double, and rounding puts
// both ends inside. Divisions by a power of two are exact.
bool fits(double low, double high, double unit) noexcept {
  constexpr double kExact = 0x1p53;
  const double first = std::floor(low / unit);
  return first >= -kExact && first + 0x1p42 <= kExact &&
         std::rint(high / unit) - first <= static_cast<double>(kLatticeMax);
}

}  // namespace

MortonKey encode_morton(const LatticePoint& point) noexcept {
  MortonKey key;
  for (int axis = 0; axis < 3; ++axis) {
    key.high |= spread(point[static_cast<std::size_t>(axis)] >> kHalfBits) << axis;
    key.low |= spread(point[static_cast<std::size_t>(axis)] & kHalfMask) << axis;
  }
  return key;
}

int octant(const MortonKey& key, int level) noexcept {
  const std::uint64_t half = level <= kHalfBits ? key.high : key.low;
  const int digit = level <= kHalfBits ? level : level - kHalfBits;
  return static_cast<int>(half >> (63 - 3 * digit) & 7);
}

MortonKey cell_of(const MortonKey& key, int level) noexcept {
  return {leading_digits(key.high, std::clamp(level, 0, kHalfBits)),
          leading_digits(key.low, std::clamp(level - kHalfBits, 0, kHalfBits))};
}

double Frame::unit() const noexcept {
  return edge * 0x1p-42;
}

LatticePoint Frame::to_lattice(const std::array<double, 3>& position) const noexcept {
  const double per_unit = 0x1p42 / edge;
  LatticePoint point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Position and origin are whole numbers of units here, so their difference is exact.
    const double steps = std::rint(position[axis] * per_unit) - origin[axis] * per_unit;
    const bool inside = steps > 0 && steps < static_cast<double>(kLatticeMax);
    point[axis] = inside ? static_cast<std::uint64_t>(steps) : steps > 0 ? kLatticeMax : 0;
  }
  return point;
}

std::array<double, 3> Frame::to_position(const LatticePoint& point) const noexcept {
  std::array<double, 3> position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    position[axis] = origin[axis] + static_cast<double>(point[axis]) * unit();
  }
  return position;
}

Frame frame_around(const std::array<double, 3>& low, const std::array<double, 3>& high) {
  // Measure the box.
  double extent = 0;
  double magnitude = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double reach = std::max(std::abs(low[axis]), std::abs(high[axis]));
    if (!(low[axis] <= high[axis]) || !(reach <= kMaxBound) ||
        !(high[axis] - low[axis] <= kMaxBound)) {
      throw std::invalid_argument("frame_around: bounds must be finite, ordered, at most 2^1000");
    }
    extent = std::max(extent, high[axis] - low[axis]);
    magnitude = std::max(magnitude, reach);
  }
  if (magnitude == 0) return {};  // every point is the origin, which any edge holds exactly

  // Find the least edge that fits. No edge below the extent or below magnitude / 2^11 can; one of
  // the next few powers of two does.
  const double least = std::max({extent, magnitude * 0x1p-11, 0x1p-960});
  int exponent = std::max(std::ilogb(least), kMinExponent);
  const auto all_fit = [&](double unit) {
    return fits(low[0], high[0], unit) && fits(low[1], high[1], unit) &&
           fits(low[2], high[2], unit);
  };
  while (!all_fit(std::ldexp(1.0, exponent - kLatticeBits))) ++exponent;

  // Round the low corner down to the lattice.
  Frame frame;
  frame.edge = std::ldexp(1.0, exponent);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    frame.origin[axis] = std::floor(low[axis] / frame.unit()) * frame.unit();
  }
  return frame;
}

}  // namespace ptc
