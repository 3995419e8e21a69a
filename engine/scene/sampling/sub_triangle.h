// The parts of a triangle that repeated halving cuts.
#pragma once

#include <array>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"

namespace ptc {

/// A part of a triangle of a mesh.
struct SubTriangle {
  std::array<glm::dvec2, 3> uv;      ///< corners as barycentric coordinates of the whole triangle
  std::array<glm::dvec3, 3> corner;  ///< corners as positions relative to Mesh::origin

  /// Returns the area, scene units squared.
  [[nodiscard]] double area() const;
  /// Returns the length of the longest edge, scene units.
  [[nodiscard]] double longest_edge() const;
  /// Returns the mean of the corners.
  [[nodiscard]] glm::dvec3 centre() const;
  /// Returns the normal on the front side, as long as twice the area.
  [[nodiscard]] glm::dvec3 normal() const;
  /// Returns one of the two halves, of equal area, into which a line from the middle of the longest
  /// edge cuts the triangle:
  ///
  ///            /|\                .
  ///          /  |   \             .
  ///        /    |      \          .
  ///      /______|_________\       .
  ///
  /// Whatever the shape is to begin with, repeated halving bounds the angles from below (Rosenberg
  /// and Stenger 1975).
  /// @param second  selects the half at the end of the longest edge instead of that at its start
  [[nodiscard]] SubTriangle half(bool second) const;
};

/// Returns a whole triangle as a part of itself.
/// @param corners  relative to Mesh::origin
[[nodiscard]] SubTriangle whole_triangle(const std::array<glm::vec3, 3>& corners);
/// Returns a whole triangle of a mesh as a part of itself.
[[nodiscard]] SubTriangle whole_triangle(const Mesh& mesh, std::uint32_t triangle);

}  // namespace ptc
