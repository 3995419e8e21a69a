// The geometry of a triangle's parts.
#include "engine/scene/sampling/sub_triangle.h"

#include <cstddef>

#include <glm/geometric.hpp>

namespace ptc {
namespace {

// Returns the corner from which the longest edge leads to the next corner; of equally long edges it
// takes the first, so that every caller cuts the same triangle the same way.
std::size_t longest_from(const std::array<glm::dvec3, 3>& corner) {
  std::size_t longest = 0;
  double most = -1;
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3 edge = corner[(i + 1) % 3] - corner[i];
    const double square = glm::dot(edge, edge);
    if (square <= most) continue;
    most = square;
    longest = i;
  }
  return longest;
}

}  // namespace

glm::dvec3 SubTriangle::normal() const {
  return glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
}

double SubTriangle::area() const {
  return 0.5 * glm::length(normal());
}

glm::dvec3 SubTriangle::centre() const {
  return (corner[0] + corner[1] + corner[2]) / 3.0;
}

double SubTriangle::longest_edge() const {
  const std::size_t i = longest_from(corner);
  return glm::distance(corner[i], corner[(i + 1) % 3]);
}

SubTriangle SubTriangle::half(bool second) const {
  const std::size_t i = longest_from(corner);
  const std::size_t next = (i + 1) % 3;
  SubTriangle result = *this;
  result.uv[second ? i : next] = 0.5 * (uv[i] + uv[next]);
  result.corner[second ? i : next] = 0.5 * (corner[i] + corner[next]);
  return result;
}

SubTriangle whole_triangle(const std::array<glm::vec3, 3>& corners) {
  return {{glm::dvec2(0, 0), glm::dvec2(1, 0), glm::dvec2(0, 1)},
          {glm::dvec3(corners[0]), glm::dvec3(corners[1]), glm::dvec3(corners[2])}};
}

SubTriangle whole_triangle(const Mesh& mesh, std::uint32_t triangle) {
  const auto& c = mesh.triangles[triangle];
  return whole_triangle({mesh.positions[c[0]], mesh.positions[c[1]], mesh.positions[c[2]]});
}

}  // namespace ptc
