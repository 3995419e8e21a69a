// A cube of direction pixels around a receiver: what covers each pixel, and the sums over them.
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
///           +------+
///          /  +y  /|      Each of the 6 faces has resolution^2 pixels. Seen from the centre, pixel
///         +------+ |      (u, v) of a face looks along w + u (its row's axis) + v (its column's
///         |  +z  |+x      axis), u and v in [-1, 1].
///         |      |/
///         +------+
///
/// The cube is turned away from the world's axes, so that walls and floors do not line up with
/// rows of pixels. Each variant turns it another way.
/// Threads: const members may be called concurrently.
class DirectionGrid {
 public:
  /// Computes the geometry, and samples the sky four times in each pixel.
  /// @param resolution  pixels along a cube edge, a multiple of 16, at most 64
  /// @param sky         radiance that arrives from a direction (unit, away from the receiver),
  ///                    W/(m^2 sr); empty where there is no sky
  /// @param variant     selects the rotation of the cube
  /// @throws std::invalid_argument at another resolution
  DirectionGrid(unsigned resolution, const std::function<glm::vec3(const glm::vec3&)>& sky,
                unsigned variant = 0);
  DirectionGrid(const DirectionGrid&) = delete;
  DirectionGrid& operator=(const DirectionGrid&) = delete;

  /// Returns the number of pixels along a cube edge.
  [[nodiscard]] unsigned resolution() const noexcept {
    return static_cast<unsigned>(geometry_.resolution);
  }
  /// Returns the variant that the constructor was given.
  [[nodiscard]] unsigned variant() const noexcept { return variant_; }
  /// Returns the rotation from the world to the axes of the cube.
  [[nodiscard]] const glm::mat3& rotation() const noexcept { return geometry_.rotation; }
  /// Returns the pixels.
  [[nodiscard]] const CubeGeometry& geometry() const noexcept { return geometry_; }
  /// Says whether there is a sky.
  [[nodiscard]] bool has_sky() const noexcept { return !sky_.empty(); }
  /// Returns the mean radiance of the sky in a pixel, W/(m^2 sr). There must be a sky.
  /// @param pixel  by face, row and column
  [[nodiscard]] glm::vec3 sky(std::size_t pixel) const;

 private:
  friend class DirectionBuffer;
  unsigned variant_;
  std::vector<float> centre_;          ///< resolution: pixel centres in [-1, 1]
  std::vector<float> inverse_length_;  ///< resolution^2: 1 / |(1, u, v)|
  std::vector<float> weight_;          ///< resolution^2: solid angle / |(1, u, v)|
  std::vector<float> edge_u_;          ///< resolution^2: CubeGeometry::edge_u
  std::vector<float> edge_v_;          ///< resolution^2: CubeGeometry::edge_v
  std::vector<float> sky_;             ///< planes of red, green and blue for each face; or empty
  CubeGeometry geometry_;              ///< pointers to the arrays above, and the rotation
};

/// The directions above the horizon of at least one normal of a cone.
struct Horizon {
  glm::vec3 axis{0};  ///< axis of the cone, unit
  /// Sine of the cone's half angle, which is below a right angle. A number above 1 stands for every
  /// direction.
  float cone_sin = 2;
};

/// What covers each direction pixel: its nearness and its RGBE colour.
///
/// Memory: 6 resolution^2 + 4 resolution pixels of 8 bytes, 4 without colours.
/// Threads: one thread at a time; several buffers may share a grid.
class DirectionBuffer {
 public:
  /// Makes an empty buffer.
  /// @param resolution  that of the grids that it will be used with
  /// @param coloured    false leaves colours out, so that resolve() gives an irradiance of 0
  explicit DirectionBuffer(unsigned resolution, bool coloured = true);

  /// Uncovers all pixels.
  void clear() noexcept;
  /// Takes over the pixels of another buffer of the same resolution and colouring.
  void copy(const DirectionBuffer& other) noexcept;

  /// Draws discs exactly: each covers every pixel whose centre ray meets it before what was drawn
  /// there. Coplanar overlapping discs divide at the line half way between their centres. The order
  /// of drawing does not matter.
  /// @param sides      which sides of the discs cover
  /// @param viewpoint  the number of the point that the discs are relative to, below kViewpoints
  /// @param horizon    pixels below it need not be drawn
  void draw(const DirectionGrid& grid, const DiscQueue& discs, Sides sides, unsigned viewpoint = 0,
            const Horizon& horizon = {}) noexcept;

  /// Sums up the hemisphere above a receiver.
  /// @param normal   unit, in the world's axes
  /// @param offsets  where the receiver lies relative to each viewpoint, in the unit of the discs;
  ///                 viewpoints beyond the last offset are the receiver itself
  /// @param weights  null: a hemisphere by its cosine
  [[nodiscard]] Shading resolve(const DirectionGrid& grid, const glm::vec3& normal,
                                std::span<const glm::vec3> offsets = {},
                                const PixelWeights* weights = nullptr) const noexcept;
  /// Returns CubePixels::nearness.
  [[nodiscard]] std::span<const float> nearness() const noexcept { return nearness_; }

 private:
  std::vector<float> nearness_;      ///< CubePixels::nearness
  std::vector<std::uint32_t> rgbe_;  ///< CubePixels::rgbe; empty without colours
};

}  // namespace ptc
