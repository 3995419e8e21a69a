// Radiance at every place of a mesh, looked up by triangle and barycentric coordinates.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"

namespace ptc::bench {

/// A grid of texels on each triangle.   Memory: 4 bytes a texel, 12 a triangle.
class Lightmap {
 public:
  /// Fills each texel with the radiance of the nearest surfel among those that face its way.
  /// @param spacing  width of a texel, scene units
  Lightmap(const Mesh& mesh, std::span<const Surfel> surfels, double spacing);

  /// @param u, v  weights of the second and third corner, u + v at most 1
  [[nodiscard]] glm::vec3 at(std::uint32_t triangle, float u, float v) const noexcept;

 private:
  struct Grid {
    std::uint64_t first = 0;  // texel
    std::uint16_t columns = 1, rows = 1;
  };

  /// @param radiance  at (u, v), as rgbe
  template <class Radiance>
  void fill(const Grid& grid, const Radiance& radiance);

  std::vector<Grid> grids_;
  std::vector<std::uint32_t> texels_;  // rgbe
};

}  // namespace ptc::bench
