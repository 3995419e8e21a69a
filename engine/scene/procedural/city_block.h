// One block of the procedural city: its place in the spiral and everything that stands on it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

namespace ptc {

inline constexpr double kBlockMetres = 16;         ///< edge of a block, streets included, metres
inline constexpr double kCityLow = -8;             ///< no block reaches lower, metres
inline constexpr double kCityHigh = 60;            ///< no block reaches higher, metres
inline constexpr std::uint32_t kCityColours = 16;  ///< number of colours that facets have
inline constexpr std::uint32_t kGroundTriangles = 128;  ///< triangles of the ground of a block

/// A parallelogram, or the half of it at its corner. Its front is the side of u x v.
///
///        +---------+
///       /  \      /       A triangle has the corners corner, corner + u and corner + v.
///     v/     \   /
///     /        \/
///     corner----+
///          u
struct Facet {
  glm::vec3 corner{0};      ///< metres from the block's low corner
  glm::vec3 u{0};           ///< one edge from the corner, metres
  glm::vec3 v{0};           ///< the other edge from the corner, metres
  std::uint8_t colour = 0;  ///< below kCityColours
  bool is_triangle = false;
};

/// The place of a block in the grid of the city.
struct BlockPlace {
  std::int64_t column = 0;  ///< along x; the block around the origin has column 0
  std::int64_t row = 0;     ///< along z; the block around the origin has row 0
};

/// Returns the place of the index-th block of a square spiral around the origin. Any number of
/// first blocks is nearly a square.
[[nodiscard]] BlockPlace block_place(std::uint64_t index);
/// Returns the low corner of a block, metres; its y is 0.
[[nodiscard]] glm::dvec3 block_corner(const BlockPlace& place);
/// Builds everything on a block. The same place gives the same facets.
[[nodiscard]] std::vector<Facet> build_block(const BlockPlace& place);
/// Returns the reflectance of a colour.
/// @param colour  below kCityColours
[[nodiscard]] glm::vec3 city_albedo(std::uint32_t colour);

}  // namespace ptc
