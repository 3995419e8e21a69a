// A latitude-longitude sky: where a direction falls on the map, and how to draw directions by
// brightness.
#pragma once

#include <memory>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/scene/light/lights.h"

namespace ptc {

/// Converts between world directions and places on a latitude-longitude map.
///
/// A place is a pair of shares: x is the turn, a share of the map's width from the left border, in
/// [0, 1); y is the rise, a share of its height from the upper border, in [0, 1]. Sky has the
/// picture of the map's sense.
class SkyOrientation {
 public:
  /// Turns the map by the smallest rotation that takes +y to `up`.
  /// @param up  of any length except 0
  explicit SkyOrientation(const glm::vec3& up);

  /// Returns the place that shows a direction.
  /// @param direction  unit
  [[nodiscard]] glm::dvec2 place_of(const glm::vec3& direction) const;
  /// Returns the unit direction that a place shows.
  [[nodiscard]] glm::vec3 direction_at(const glm::dvec2& place) const;

 private:
  glm::dvec3 x_, y_, z_;  ///< the map's axes in the world
};

/// Draws directions with a density that follows the brightness of a map, interpolated as the map
/// itself is.
/// Memory: bytes().   Threads: const members may be called concurrently.
class SkyDensity {
 public:
  /// Sums up the brightness of a sky's map.
  /// @param sky  has a map with pixels
  explicit SkyDensity(const Sky& sky);

  /// Returns the memory of the density of a sky, bytes: at most some 4 MiB, or an eighth of a byte
  /// for each pixel.
  [[nodiscard]] static std::uint64_t bytes(const Sky& sky) noexcept;

  /// An interval in a list of cumulated shares.
  struct Found {
    std::size_t index;  ///< of the interval
    double within;      ///< where in it the value lies, in [0, 1]
  };
  /// A direction and the density that it was drawn with.
  struct Sample {
    glm::vec3 direction{0};  ///< unit
    float density = 0;       ///< per steradian
  };
  /// Turns a uniform point of the unit square into a direction by brightness.
  [[nodiscard]] Sample sample(const glm::vec2& square) const;
  /// Returns the density with which sample() gives `direction`, per steradian.
  [[nodiscard]] float density(const glm::vec3& direction) const;
  /// Reports whether no direction is brighter than 0; then there is nothing to draw.
  [[nodiscard]] bool is_black() const noexcept { return !(rows_.back() > 0); }

 private:
  /// Returns the number of pixels of a block: the fewest that give not too many blocks.
  [[nodiscard]] static unsigned block_of(const Texture& map) noexcept;

  /// Returns the weight of a pixel: its brightness times the solid angle of a pixel of its row, up
  /// to a factor.
  [[nodiscard]] double weight(unsigned column, unsigned row) const;
  /// Finds the pixel of a block that holds a share of its weight.
  /// @param begin  column of the block's first pixel
  [[nodiscard]] Found find_in_block(unsigned begin, unsigned row, double share) const;
  /// Returns the density at a place of the map, per steradian.
  [[nodiscard]] float density_at(const glm::dvec2& place) const;

  SkyOrientation orientation_;
  std::shared_ptr<const Texture> map_;
  unsigned width_, height_;    ///< of the map, pixels
  unsigned block_;             ///< pixels of a block
  unsigned blocks_of_row_;     ///< the last may be narrower
  std::vector<double> sines_;  ///< sine of the polar angle at the middle of each row
  std::vector<double> rows_;   ///< weight of all rows up to and including each
  std::vector<float> blocks_;  ///< within each row, the share up to and including each block
};

/// Columns of the map that a gather takes: its direction pixels are at least half as wide.
inline constexpr unsigned kGatheredColumns = 128;

/// Returns a sky whose map has no more columns than a gather can tell apart: each pixel is the mean
/// of the map over its solid angle, so that small bright spots such as the sun keep their light
/// where a direction pixel is larger than they are.
/// @param width  greatest number of columns, even; half as many rows
/// @return  the sky itself where its map has no more of both, or where it has none
/// Time: that of reading the map once.   Memory: smooth_sky_bytes().
[[nodiscard]] Sky smooth_sky(const Sky& sky, unsigned width = kGatheredColumns);

/// Returns the most memory that smooth_sky() takes while it makes a map, bytes: sums, pixels and
/// the texture of them.
[[nodiscard]] constexpr std::uint64_t smooth_sky_bytes(unsigned width = kGatheredColumns) noexcept {
  return std::uint64_t{width} * (width / 2) * 48;
}

}  // namespace ptc
