// Radiance at every place of a mesh, looked up by triangle and barycentric coordinates: the baked
// light that rays find at their hits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"

namespace ptc::bench {

/// A grid of texels on each triangle, u along its columns and v along its rows. The far edge of the
/// triangle, u + v = 1, cuts the grid's diagonal:
///
///   corner 2
///      +
///    v | .         rows    = ceil(edge from corner 0 to corner 2 / spacing)
///      |   .       columns = ceil(edge from corner 0 to corner 1 / spacing)
///      +-----+
///  corner 0  u  corner 1
///
/// Memory: 4 bytes a texel, 16 a triangle.   Threads: at() may be called concurrently.
class Lightmap {
 public:
  /// Fills each texel with the radiance of the nearest surfel whose normal is like the triangle's,
  /// or of the nearest surfel where none of its 8 neighbours has such a normal.
  /// @param spacing  width of a texel, scene units
  Lightmap(const Mesh& mesh, std::span<const Surfel> surfels, double spacing);

  /// Returns the radiance of the texel at a place of a triangle.
  /// @param u, v  weights of the second and third corner, u + v at most 1
  [[nodiscard]] glm::vec3 at(std::uint32_t triangle, float u, float v) const noexcept;

 private:
  struct Grid {
    std::uint64_t first = 0;              ///< index of its first texel
    std::uint16_t columns = 1, rows = 1;  ///< texels, each from 1 to 8192
  };

  /// Sets the texels of a grid that the triangle covers.
  /// @param radiance  function of (u, v) that returns radiance as rgbe
  template <class Radiance>
  void fill(const Grid& grid, const Radiance& radiance);

  std::vector<Grid> grids_;
  std::vector<std::uint32_t> texels_;  ///< rgbe, row by row
};

}  // namespace ptc::bench
