// Meshes made in code, and random numbers, for the tests of this layer.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

/// Returns a mesh without triangles and with one material: albedo 0.5, one-sided.
[[nodiscard]] Mesh empty_mesh();
void add_triangle(Mesh& mesh, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c,
                  std::uint16_t material = 0);
/// Adds two triangles whose front is on the side of u x v.
void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
              std::uint16_t material = 0);
/// Adds the six sides of a box, whose fronts face outwards or inwards.
void add_box(Mesh& mesh, const glm::vec3& low, const glm::vec3& high, bool inward);

/// Returns a square of the plane y = 0 around the origin that faces up.
[[nodiscard]] Mesh ground(float half_width);
[[nodiscard]] Mesh sphere(float radius, int rings);

/// Turns all positions; the origin of the mesh stays.
void turn(Mesh& mesh, const glm::mat3& rotation);

/// Returns the area of one side of all triangles.
[[nodiscard]] double one_sided_area(const Mesh& mesh);
[[nodiscard]] std::vector<Surfel> drain(PointSource& source, std::size_t block = 1000);

/// A fixed sequence of random numbers.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  double unit();
  double between(double low, double high) { return low + (high - low) * unit(); }
  glm::dvec3 in_box(double low, double high);
  glm::vec3 direction();
  glm::mat3 rotation();

 private:
  std::uint64_t state_;
};

}  // namespace ptc
