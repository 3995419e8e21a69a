// What is known beforehand about the side to which normals point.
#pragma once

#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scan/scan_spool.h"
#include "format/morton.h"

namespace ptc {

/// Knows the scanners of a cloud and the direction from which it was seen.
class KnownSides {
 public:
  /// @param scanners  places of the scanners in scene units, by number; may be empty
  /// @param up        the axis that points up; any length above 0
  /// @param aerial    normals point up
  KnownSides(const Frame& frame, const std::vector<glm::dvec3>& scanners, const glm::dvec3& up,
             bool aerial);

  /// Returns the unit vector towards the side from which a place was seen; none when that is not
  /// known.
  [[nodiscard]] std::optional<std::array<float, 3>> towards(
      const Place& place, const LatticePosition& position) const noexcept;
  /// The unit vector that points up.
  [[nodiscard]] const std::array<float, 3>& up() const noexcept { return up_; }

 private:
  std::vector<LatticePosition> scanners_;  ///< in lattice units, also outside of the lattice
  std::array<float, 3> up_;
  bool aerial_;
};

}  // namespace ptc
