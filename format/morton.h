// The lattice on which all positions lie, and the Z-curve over it (spec/morton.md).
#pragma once

#include <array>
#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>

namespace ptc {

inline constexpr int kLatticeBits = 42;  ///< bits per axis; the octree has 42 levels, too
inline constexpr int kHalfBits = kLatticeBits / 2;  ///< octal digits in each half of a key
inline constexpr std::uint64_t kLatticeMax =
    (std::uint64_t{1} << kLatticeBits) - 1;  ///< greatest coordinate

/// A point of the lattice: x, y and z, each in [0, 2^42).
using LatticePoint = std::array<std::uint64_t, 3>;

/// The place of a lattice point on the Z-curve: 126 bits, one octal digit (z y x) per level of the
/// octree. Keys are ordered like the points along the curve.
///
///   high = 0 zyx zyx ... zyx   levels 1 to 21     low = 0 zyx ... zyx   levels 22 to 42
struct MortonKey {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  friend auto operator<=>(const MortonKey&, const MortonKey&) = default;  // NOLINT(*-nullptr)
};

namespace detail {

/// Gathers bits 0, 3, 6, ... 60 of a half of a key into bits 0 to 20.
[[nodiscard]] inline std::uint64_t every_third_bit(std::uint64_t v) noexcept {
  v &= 0x1249249249249249;
  v = (v | v >> 2) & 0x10c30c30c30c30c3;
  v = (v | v >> 4) & 0x100f00f00f00f00f;
  v = (v | v >> 8) & 0x001f0000ff0000ff;
  v = (v | v >> 16) & 0x001f00000000ffff;
  v = (v | v >> 32) & 0x1fffff;
  return v;
}

/// Returns the coordinate of a key along an axis: 0 for x, 1 for y, 2 for z.
[[nodiscard]] inline std::uint64_t coordinate(std::uint64_t high, std::uint64_t low,
                                              std::size_t axis) noexcept {
  return every_third_bit(high >> axis) << kHalfBits | every_third_bit(low >> axis);
}

}  // namespace detail

/// Returns the key of a lattice point. @pre each coordinate is below 2^42
[[nodiscard]] MortonKey encode_morton(const LatticePoint& point) noexcept;
/// Returns the lattice point of a key; the inverse of encode_morton().
[[nodiscard]] inline LatticePoint decode_morton(const MortonKey& key) noexcept {
  return {detail::coordinate(key.high, key.low, 0), detail::coordinate(key.high, key.low, 1),
          detail::coordinate(key.high, key.low, 2)};
}

/// Returns the number of leading octal digits that a and b share, which is the level of the
/// smallest cell that holds both: 0 (only the root cell) to 42 (equal keys).
[[nodiscard]] inline int common_level(const MortonKey& a, const MortonKey& b) noexcept {
  // Bit 63 of a half is unused, so a difference in the first digit has one to three leading zeros.
  if (const std::uint64_t differ = a.high ^ b.high) return (std::countl_zero(differ) - 1) / 3;
  if (const std::uint64_t differ = a.low ^ b.low) {
    return kHalfBits + (std::countl_zero(differ) - 1) / 3;
  }
  return kLatticeBits;
}

/// Returns the octal digit of the key at `level` in [1, 42]: the child, 0 to 7, that holds the key
/// in its cell at level - 1.
[[nodiscard]] int octant(const MortonKey& key, int level) noexcept;

/// Returns the key with every digit below `level` set to zero, which is the low corner of its cell
/// at that level. Levels from 42 on give the key itself.
[[nodiscard]] MortonKey cell_of(const MortonKey& key, int level) noexcept;

/// A cube that holds every point, divided into 2^42 lattice units along each axis.
///
/// The edge is a power of two and the origin is a multiple of edge / 2^42. So positions whose bits
/// fit the lattice (all floats above edge / 2^18 in magnitude) come back exactly.
struct Frame {
  std::array<double, 3> origin{};  ///< low corner, scene units
  double edge = 1;                 ///< a power of two, scene units

  /// Returns the length of a lattice unit in scene units: edge / 2^42.
  [[nodiscard]] double unit() const noexcept;
  /// Returns the lattice point nearest to a position; coordinates outside the cube are clamped to
  /// its faces.
  [[nodiscard]] LatticePoint to_lattice(const std::array<double, 3>& position) const noexcept;
  /// Returns the position of a lattice point in scene units. The result is exact.
  [[nodiscard]] std::array<double, 3> to_position(const LatticePoint& point) const noexcept;
};

/// Returns the smallest frame that holds every position of a box within half a unit and whose
/// lattice points are doubles: the unit is not below the spacing of doubles at the box's distance
/// from 0. If the box is the single point 0, the edge is 1.
/// @param low, high  opposite corners of the box, scene units
/// @throws std::invalid_argument when a bound is not finite, low > high, or a bound or the
///         extent is above 2^1000
[[nodiscard]] Frame frame_around(const std::array<double, 3>& low,
                                 const std::array<double, 3>& high);

}  // namespace ptc
