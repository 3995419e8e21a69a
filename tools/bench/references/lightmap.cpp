#include "tools/bench/references/lightmap.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>
#include <nanoflann.hpp>

#include "engine/parallel/thread_pool.h"
#include "format/scalar.h"

namespace ptc::bench {
namespace {

constexpr std::size_t kNeighbours = 8;  // surfels among which a texel chooses
constexpr float kAlike = 0.7F;          // least cosine between normals of one surface

/// What nanoflann asks of a point set.
struct Cloud {
  std::span<const Surfel> surfels;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return surfels.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return surfels[i].position[static_cast<int>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud,
                                                 3, std::size_t>;

/// The radiance, as rgbe, of the nearest neighbour that faces the same way, else of the nearest.
std::uint32_t nearest_radiance(const Tree& tree, std::span<const Surfel> surfels,
                               const glm::dvec3& at, const glm::vec3& normal) {
  std::array<std::size_t, kNeighbours> found{};
  std::array<double, kNeighbours> distances{};
  const std::array<double, 3> query{at.x, at.y, at.z};
  const std::size_t count =
      tree.knnSearch(query.data(), kNeighbours, found.data(), distances.data());
  if (count == 0) return 0;
  const auto* best = std::find_if(found.data(), found.data() + count, [&](std::size_t i) {
    return glm::dot(surfels[i].normal, normal) > kAlike;
  });
  const Surfel& s = surfels[best == found.data() + count ? found[0] : *best];
  return encode_rgbe({s.radiance.r, s.radiance.g, s.radiance.b});
}

std::uint16_t texels_along(float length, double spacing) {
  return static_cast<std::uint16_t>(
      std::clamp(std::ceil(static_cast<double>(length) / spacing), 1.0, 8192.0));
}

}  // namespace

template <class Radiance>
void Lightmap::fill(const Grid& grid, const Radiance& radiance) {
  const unsigned columns = grid.columns, rows = grid.rows;
  // A texel that the far edge cuts takes its radiance from the middle of the part inside: on the
  // edge itself, surfels beyond it would be as near.
  const float most = 1 - 1 / (3 * static_cast<float>(std::max(columns, rows)));
  for (unsigned row = 0; row < rows; ++row) {
    for (unsigned column = 0; column < columns; ++column) {
      // Texels beyond the far edge stay black, except the first ones: rounding can lead at() there.
      if (column * rows + row * columns > columns * rows + std::max(columns, rows)) break;
      const float x = (static_cast<float>(column) + 0.5F) / static_cast<float>(columns);
      const float y = (static_cast<float>(row) + 0.5F) / static_cast<float>(rows);
      const float over = std::max(1.0F, (x + y) / most);
      texels_[grid.first + row * columns + column] = radiance(x / over, y / over);
    }
  }
}

Lightmap::Lightmap(const Mesh& mesh, std::span<const Surfel> surfels, double spacing) {
  // Give each triangle a grid
  grids_.resize(mesh.triangles.size());
  std::uint64_t count = 0;
  const auto corner = [&](std::size_t triangle, std::size_t k) {
    return mesh.positions[mesh.triangles[triangle][k]];
  };
  for (std::size_t t = 0; t < grids_.size(); ++t) {
    grids_[t] = {count, texels_along(glm::length(corner(t, 1) - corner(t, 0)), spacing),
                 texels_along(glm::length(corner(t, 2) - corner(t, 0)), spacing)};
    count += std::uint64_t{grids_[t].columns} * grids_[t].rows;
  }
  texels_.resize(count);
  // Find the surfel for each texel
  const Cloud cloud{surfels};
  const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  const ThreadPool executor;
  executor.for_ranges(grids_.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const glm::vec3 a = corner(t, 0), u = corner(t, 1) - a, v = corner(t, 2) - a;
      const glm::vec3 normal = glm::normalize(glm::cross(u, v));
      fill(grids_[t], [&](float x, float y) {
        return nearest_radiance(tree, surfels, mesh.origin + glm::dvec3(a + u * x + v * y), normal);
      });
    }
  });
}

glm::vec3 Lightmap::at(std::uint32_t triangle, float u, float v) const noexcept {
  const Grid& grid = grids_[triangle];
  const auto place = [](float x, std::uint16_t size) {
    return std::min(static_cast<unsigned>(std::max(0.0F, x * size)), size - 1U);
  };
  const auto rgb = decode_rgbe(
      texels_[grid.first + place(v, grid.rows) * grid.columns + place(u, grid.columns)]);
  return {rgb[0], rgb[1], rgb[2]};
}

}  // namespace ptc::bench
