// A cube of direction pixels around a receiver: what covers each of them, and how light adds up.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/kernels/direction_kernels.h"
#include "engine/shade/shading.h"

namespace ptc {

/// The geometry of the pixels, shared by all buffers of a run: directions, exact solid angles, sky.
///
/// The cube is turned away from the world's axes, so that walls and floors do not line up with
/// pixel rows; each variant another way.
class DirectionGrid {
 public:
  /// @param resolution  pixels along a cube edge, a multiple of 16, at most 64
  /// @throws std::invalid_argument at another resolution
  /// @param sky  radiance from a direction (unit, away from the receiver), or empty: no sky
  DirectionGrid(unsigned resolution, const std::function<glm::vec3(const glm::vec3&)>& sky,
                unsigned variant = 0);
  DirectionGrid(const DirectionGrid&) = delete;
  DirectionGrid& operator=(const DirectionGrid&) = delete;

  [[nodiscard]] unsigned resolution() const noexcept {
    return static_cast<unsigned>(geometry_.resolution);
  }
  [[nodiscard]] unsigned variant() const noexcept { return variant_; }
  /// From the world to the axes of the cube.
  [[nodiscard]] const glm::mat3& rotation() const noexcept { return geometry_.rotation; }

 private:
  friend class DirectionBuffer;
  unsigned variant_;
  std::vector<float> centre_;          // resolution: pixel centres in [-1, 1]
  std::vector<float> inverse_length_;  // resolution^2: 1 / |(1, u, v)|
  std::vector<float> weight_;          // resolution^2: solid angle / length
  std::vector<float> edge_u_;          // as CubeGeometry has them
  std::vector<float> edge_v_;
  std::vector<float> sky_;  // by face: planes of red, green, blue; or empty
  CubeGeometry geometry_;   // of the above, and the rotation
};

/// Directions over the horizon of some normal of a cone.
struct Horizon {
  glm::vec3 axis{0};  ///< unit
  float cone_sin =
      2;  ///< sine of the cone's half angle, which is below a right one; above 1: every direction
};

/// Nearest coverer of every direction pixel and its RGBE colour.
class DirectionBuffer {
 public:
  /// @param resolution  of the grids that it will be used with
  /// @param coloured    false: what covers has no colour, irradiance is 0
  explicit DirectionBuffer(unsigned resolution, bool coloured = true);

  void clear() noexcept;
  void copy(const DirectionBuffer& other) noexcept;

  /// Draws discs exactly: every pixel whose ray meets one. Coplanar overlapping discs divide at the
  /// line between their centres. The order of drawing does not matter.
  /// @param viewpoint  what the discs are relative to, below kViewpoints
  /// @param horizon    pixels below it may be left as they are
  void draw(const DirectionGrid& grid, const DiscQueue& discs, Sides sides, unsigned viewpoint = 0,
            const Horizon& horizon = {}) noexcept;

  /// Sums over the hemisphere of `normal`.
  /// @param offsets  of the receiver from each viewpoint; those that follow are 0. Empty: from none
  [[nodiscard]] Shading resolve(const DirectionGrid& grid, const glm::vec3& normal,
                                std::span<const glm::vec3> offsets = {}) const noexcept;

 private:
  std::vector<float> nearness_;      // CubePixels
  std::vector<std::uint32_t> rgbe_;  // empty without colours
};

}  // namespace ptc
