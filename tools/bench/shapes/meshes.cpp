#include "tools/bench/shapes/meshes.h"

#include <cmath>

#include "engine/base/numbers.h"
#include "format/scalar.h"

namespace ptc::bench {

Mesh empty_mesh() {
  Mesh mesh;
  mesh.materials.emplace_back();
  return mesh;
}

void add_triangle(Mesh& mesh, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c,
                  std::uint16_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.material_of.push_back(material);
}

void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
              std::uint16_t material) {
  add_triangle(mesh, corner, corner + u, corner + u + v, material);
  add_triangle(mesh, corner, corner + u + v, corner + v, material);
}

void add_box(Mesh& mesh, const glm::vec3& low, const glm::vec3& high, bool inward) {
  const glm::vec3 side[3] = {
      {high.x - low.x, 0, 0}, {0, high.y - low.y, 0}, {0, 0, high.z - low.z}};
  for (int axis = 0; axis < 3; ++axis) {
    const glm::vec3& u = side[(axis + 1) % 3];
    const glm::vec3& v = side[(axis + 2) % 3];
    add_quad(mesh, low, inward ? u : v, inward ? v : u);
    add_quad(mesh, low + side[axis], inward ? v : u, inward ? u : v);
  }
}

Mesh ground(float half_width) {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {-half_width, 0, half_width}, {2 * half_width, 0, 0}, {0, 0, -2 * half_width});
  return mesh;
}

Mesh sphere(float radius, int rings) {
  Mesh mesh = empty_mesh();
  const auto at = [&](int i, int j) {
    const float polar = kPi * static_cast<float>(i) / static_cast<float>(rings);
    const float turn = kPi * static_cast<float>(j % (2 * rings)) / static_cast<float>(rings);
    return radius * glm::vec3(std::sin(polar) * std::sin(turn), std::cos(polar),
                              std::sin(polar) * std::cos(turn));
  };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < 2 * rings; ++j) {
      if (i + 1 < rings) add_triangle(mesh, at(i, j), at(i + 1, j), at(i + 1, j + 1));
      if (i > 0) add_triangle(mesh, at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  return mesh;
}

void turn(Mesh& mesh, const glm::mat3& rotation) {
  for (glm::vec3& p : mesh.positions) p = rotation * p;
}

}  // namespace ptc::bench
