// Sums over neighbouring surfels, which tell whether one can stand for all, and what it is.
#pragma once

#include <cstdint>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/octree/flat_cells.h"
#include "format/point_record.h"

namespace ptc {

/// Sums of a colour over surfels, by area.
struct ColourSums {
  glm::dvec3 first{0}, second{0};  ///< of the values, of their squares

  void add(const glm::dvec3& value, double area);
  void add(const ColourSums& other);
  [[nodiscard]] double square() const { return second.x + second.y + second.z; }
  /// Returns the sum of the squares by which the values differ from their mean.
  [[nodiscard]] double change(double area) const;
  /// Says whether the values deviate from their mean by at most `contrast` of its brightest
  /// channel.
  [[nodiscard]] bool is_even(double area, double contrast) const;
};

/// Sums over surfels. Lengths are in lattice units.
struct ClusterSums {
  std::uint64_t count = 1;  ///< of the surfels
  double area = 0;          ///< of all
  glm::dvec3 mean{0};       ///< of their positions, by area
  double reach = 0;         ///< greatest distance of their rims from the mean, at most
  double least = 0;         ///< least of their radii
  glm::dvec3 facing{0};     ///< sum of their normals, by area
  glm::dmat3 spread{0};     ///< second moments about the mean of the squares that they stand for
  ColourSums radiance, emission, albedo;

  /// Makes the sums of one surfel. @param unit  lattice unit in scene units
  ClusterSums(const PointRecord& point, double unit);

  /// Adds other surfels, but for the reach. @pre one of the areas is not 0
  void add(const ClusterSums& other);

  /// Returns the area of the surfel that stands for them.
  [[nodiscard]] double covered() const;
  /// Returns their mean radius.
  [[nodiscard]] double finest() const;
  /// Says whether they are as near to a flat and even surface, and as few, as is asked.
  [[nodiscard]] bool is_flat(const Flatness& most) const;
  /// Says whether the surfel that stands for them covers about what they cover.
  [[nodiscard]] bool is_round(const Flatness& most) const;
  /// Returns the surfel that stands for them.
  /// @param like   one of them, which gives what is not summed
  /// @param level  of the cell that they fill
  /// @param unit   lattice unit in scene units
  [[nodiscard]] PointRecord surfel(PointRecord like, int level, double unit) const;
  /// Returns what becomes of them. @param one  whether one surfel stands for all
  [[nodiscard]] MergeCounts counts(bool one) const;
};

}  // namespace ptc
