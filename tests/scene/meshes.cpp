#include "tests/scene/meshes.h"

#include <glm/geometric.hpp>

namespace ptc {

double one_sided_area(const Mesh& mesh) {
  double area = 0;
  for (const auto& t : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[t[0]]);
    area += 0.5 * glm::length(glm::cross(glm::dvec3(mesh.positions[t[1]]) - a,
                                         glm::dvec3(mesh.positions[t[2]]) - a));
  }
  return area;
}

std::vector<Surfel> drain(PointSource& source, std::size_t block) {
  std::vector<Surfel> all;
  std::vector<Surfel> some(block);
  while (const std::size_t count = source.next(some)) {
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return all;
}

}  // namespace ptc
