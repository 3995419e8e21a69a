// Internal to the mesh readers: the rules by which polygons of a file become triangles, which hold
// in memory and on the disk alike.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/error.h"
#include "engine/base/surfel.h"

namespace ptc {

/// Says whether a triangle of float positions has an area.
[[nodiscard]] inline bool has_area(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
  const glm::dvec3 at(a);
  return glm::cross(glm::dvec3(b) - at, glm::dvec3(c) - at) != glm::dvec3(0);
}

/// Returns the unit normal of a triangle; +z for one without an area.
[[nodiscard]] inline glm::vec3 flat_normal(const glm::vec3& a, const glm::vec3& b,
                                           const glm::vec3& c) {
  const glm::dvec3 at(a);
  const glm::dvec3 flat = glm::cross(glm::dvec3(b) - at, glm::dvec3(c) - at);
  const double length = glm::length(flat);
  return length > 0 ? glm::vec3(flat / length) : glm::vec3(0, 0, 1);
}

/// Scales a normal to unit length. One that cannot be scaled becomes 0, which means missing.
[[nodiscard]] inline glm::vec3 unit_or_missing(const glm::vec3& normal) {
  const double length = glm::length(glm::dvec3(normal));
  return std::isfinite(length) && length > 0 ? glm::vec3(glm::dvec3(normal) / length)
                                             : glm::vec3(0);
}

[[nodiscard]] inline glm::vec2 finite_or_zero(const glm::vec2& uv) {
  return std::isfinite(uv.x) && std::isfinite(uv.y) ? uv : glm::vec2(0);
}

/// Checks the positions of a mesh, one after another, and finds its origin.
class PositionCheck {
 public:
  /// @param path  name of the file for errors
  explicit PositionCheck(const std::filesystem::path& path) : path_(path) {}

  /// @throws DataError when the position is not finite or too large
  void add(const glm::dvec3& p) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      refuse("the position is not finite");
    if (!fits_coordinates(p)) refuse("the position is beyond 2^999");
    bounds_.add(p);
    ++count_;
  }

  /// Returns the centre of the box around all positions, rounded to integers.
  /// @throws DataError when they are too far apart
  [[nodiscard]] glm::dvec3 origin() const {
    // Beyond this distance from the centre along an axis, squares leave the range of float
    constexpr double kMaxExtent = 1e18;
    if (bounds_.empty()) return glm::dvec3(0);
    const glm::dvec3 half = bounds_.high / 2.0 - bounds_.low / 2.0;
    if (half.x > kMaxExtent || half.y > kMaxExtent || half.z > kMaxExtent)
      throw DataError(path_.string() + ": positions are more than 2e18 apart");
    return glm::round(bounds_.low / 2.0 + bounds_.high / 2.0);
  }

 private:
  [[noreturn]] void refuse(const char* rule) const {
    throw DataError(path_.string() + ": vertex " + std::to_string(count_) + ": " + rule);
  }

  const std::filesystem::path& path_;
  Bounds bounds_;
  std::uint64_t count_ = 0;
};

}  // namespace ptc
