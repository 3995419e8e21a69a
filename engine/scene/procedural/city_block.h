// What stands on one block of the city.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

namespace ptc {

inline constexpr double kBlockMetres = 16;
inline constexpr double kCityLow = -8;   ///< no block reaches lower,
inline constexpr double kCityHigh = 60;  ///< or higher; metres
inline constexpr std::uint32_t kCityColours = 16;
inline constexpr std::uint32_t kGroundTriangles = 128;  ///< of each block

/// A parallelogram, or its half at the corner; the front is the side of u x v.
struct Facet {
  glm::vec3 corner{0};  ///< metres from the block's low corner
  glm::vec3 u{0};
  glm::vec3 v{0};
  std::uint8_t colour = 0;  ///< below kCityColours
  bool is_triangle = false;
};

/// Which block: column and row, 0 at the origin.
struct BlockPlace {
  std::int64_t column = 0;
  std::int64_t row = 0;
};

/// The index-th block of a square spiral around the origin: any number of first blocks is nearly a
/// square.
[[nodiscard]] BlockPlace block_place(std::uint64_t index);
/// Low corner of a block, metres; y is 0.
[[nodiscard]] glm::dvec3 block_corner(const BlockPlace& place);
/// Everything on a block; the same for the same place.
[[nodiscard]] std::vector<Facet> build_block(const BlockPlace& place);
/// Reflectance of a colour.
[[nodiscard]] glm::vec3 city_albedo(std::uint32_t colour);

}  // namespace ptc
