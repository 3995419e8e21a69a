// Meshes of simple shapes.
#pragma once

#include <cstdint>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"

namespace ptc::bench {

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

}  // namespace ptc::bench
