// The lattice that positions live on and the Z-curve over it (spec/morton.md).
#pragma once

#include <array>
#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>

namespace ptc {

inline constexpr int kLatticeBits = 42;  ///< bits per axis; the octree has as many levels
inline constexpr int kHalfBits = kLatticeBits / 2;  ///< digits in each half of a key
inline constexpr std::uint64_t kLatticeMax = (std::uint64_t{1} << kLatticeBits) - 1;

/// A point of the lattice: each coordinate in [0, 2^42).
using LatticePoint = std::array<std::uint64_t, 3>;

/// Place of a lattice point on the Z-curve: 126 bits, one octal digit (z y x) per octree level.
///
///   high = 0 zyx zyx ... zyx   levels 1 to 21     low = 0 zyx ... zyx   levels 22 to 42
struct MortonKey {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  friend auto operator<=>(const MortonKey&, const MortonKey&) = default;  // NOLINT(*-nullptr)
};

namespace detail {

/// Bits 0, 3, 6, ... of a half of a key, put together.
[[nodiscard]] inline std::uint64_t every_third_bit(std::uint64_t v) noexcept {
  v &= 0x1249249249249249;
  v = (v | v >> 2) & 0x10c30c30c30c30c3;
  v = (v | v >> 4) & 0x100f00f00f00f00f;
  v = (v | v >> 8) & 0x001f0000ff0000ff;
  v = (v | v >> 16) & 0x001f00000000ffff;
  v = (v | v >> 32) & 0x1fffff;
  return v;
}

/// Coordinate of an axis, 0 to 2, of a key.
[[nodiscard]] inline std::uint64_t coordinate(std::uint64_t high, std::uint64_t low,
                                              std::size_t axis) noexcept {
  return every_third_bit(high >> axis) << kHalfBits | every_third_bit(low >> axis);
}

}  // namespace detail

/// The key of a lattice point, and back. Bits of coordinates above the 42nd must be zero.
[[nodiscard]] MortonKey encode_morton(const LatticePoint& point) noexcept;
[[nodiscard]] inline LatticePoint decode_morton(const MortonKey& key) noexcept {
  return {detail::coordinate(key.high, key.low, 0), detail::coordinate(key.high, key.low, 1),
          detail::coordinate(key.high, key.low, 2)};
}

/// Number of leading octal digits that a and b share: 0 (only the root cell) to 42 (equal keys).
[[nodiscard]] inline int common_level(const MortonKey& a, const MortonKey& b) noexcept {
  // Bit 63 of a half is unused: a difference in the first digit has one to three leading zeros.
  if (const std::uint64_t differ = a.high ^ b.high) return (std::countl_zero(differ) - 1) / 3;
  if (const std::uint64_t differ = a.low ^ b.low) {
    return kHalfBits + (std::countl_zero(differ) - 1) / 3;
  }
  return kLatticeBits;
}

/// Octal digit of the key at `level` in [1, 42]: which child of its cell at level - 1 it lies in.
[[nodiscard]] int octant(const MortonKey& key, int level) noexcept;

/// The key with every digit below `level` zero: the low corner of its cell at that level.
/// Levels from 42 on give the key itself.
[[nodiscard]] MortonKey cell_of(const MortonKey& key, int level) noexcept;

/// A cube that holds every point, and the lattice laid over it.
///
/// The edge is a power of two and the origin a multiple of edge / 2^42, so positions whose bits
/// fit the lattice (all floats above edge / 2^18 in magnitude) come back exactly.
struct Frame {
  std::array<double, 3> origin{};  ///< low corner, in scene units
  double edge = 1;                 ///< a power of two, in scene units

  /// Lattice unit in scene units: edge / 2^42.
  [[nodiscard]] double unit() const noexcept;
  /// Nearest lattice point; coordinates outside the cube are clamped to its faces.
  [[nodiscard]] LatticePoint to_lattice(const std::array<double, 3>& position) const noexcept;
  /// The position of a lattice point, without rounding.
  [[nodiscard]] std::array<double, 3> to_position(const LatticePoint& point) const noexcept;
};

/// The smallest frame that holds every position of a box within half a unit and whose lattice
/// points are doubles: the unit is not below what doubles tell apart at the box's distance from 0.
/// For a box that is the point 0 the edge is 1.
/// @throws std::invalid_argument when a bound is not finite, low > high, or a bound or the
///         extent is above 2^1000
[[nodiscard]] Frame frame_around(const std::array<double, 3>& low,
                                 const std::array<double, 3>& high);

}  // namespace ptc
