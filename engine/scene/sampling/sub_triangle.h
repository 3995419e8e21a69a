// Parts of a triangle, cut by halving.
#pragma once

#include <array>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"

namespace ptc {

/// A part of a triangle: corners as barycentric coordinates and as positions relative to
/// Mesh::origin.
struct SubTriangle {
  std::array<glm::dvec2, 3> uv;
  std::array<glm::dvec3, 3> corner;

  [[nodiscard]] double area() const;
  [[nodiscard]] double longest_edge() const;
  [[nodiscard]] glm::dvec3 centre() const;
  /// Twice the area long; towards the front.
  [[nodiscard]] glm::dvec3 normal() const;
  /// One of the halves into which the middle of the longest edge cuts it, of equal area. Whatever
  /// the shape to begin with, repeated halving leads to angles that are not small (Rosenberg and
  /// Stenger 1975).
  [[nodiscard]] SubTriangle half(bool second) const;
};

[[nodiscard]] SubTriangle whole_triangle(const Mesh& mesh, std::uint32_t triangle);

}  // namespace ptc
