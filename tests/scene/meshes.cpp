// Meshes made in code.
#include "tests/scene/meshes.h"

#include <cmath>

#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/sampling/directions.h"

namespace ptc {

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

double Random::unit() {
  state_ = splitmix64(state_);
  return static_cast<double>(state_ >> 11) * 0x1p-53;
}

glm::dvec3 Random::in_box(double low, double high) {
  const double x = between(low, high);
  const double y = between(low, high);
  return {x, y, between(low, high)};
}

glm::vec3 Random::direction() {
  for (;;) {
    const glm::dvec3 p = in_box(-1, 1);
    const double length = glm::length(p);
    if (length > 0.01 && length < 1) return glm::vec3(p / length);
  }
}

glm::mat3 Random::rotation() {
  const Basis basis(direction());
  return {basis.x, basis.y, basis.z};
}

}  // namespace ptc
