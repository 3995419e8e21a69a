// A latitude-longitude sky: where a direction falls on the map, and directions by brightness.
#pragma once

#include <memory>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/scene/light/lights.h"

namespace ptc {

/// Between world directions and the map's turn and rise, each in [0, 1): x over the width from the
/// left, y over the height from the top. See Sky for the sense.
class SkyOrientation {
 public:
  explicit SkyOrientation(const glm::vec3& up);

  [[nodiscard]] glm::dvec2 place_of(const glm::vec3& direction) const;
  [[nodiscard]] glm::vec3 direction_at(const glm::dvec2& place) const;

 private:
  glm::dvec3 x_, y_, z_;  // the map's axes in the world
};

/// Directions with a density that follows the map's brightness, bilinear as the map is.
/// Memory: 4 bytes a pixel.
class SkyDensity {
 public:
  /// @param sky  has a map
  explicit SkyDensity(const Sky& sky);

  struct Sample {
    glm::vec3 direction{0};
    float density = 0;  ///< per steradian
  };
  [[nodiscard]] Sample sample(const glm::vec2& square) const;
  /// Density with which sample() gives `direction`, per steradian.
  [[nodiscard]] float density(const glm::vec3& direction) const;
  /// True when no direction is brighter than 0.
  [[nodiscard]] bool is_black() const noexcept { return !(rows_.back() > 0); }

 private:
  // What a pixel weighs: its brightness times the solid angle of its row.
  [[nodiscard]] double weight(unsigned column, unsigned row) const;
  [[nodiscard]] float density_at(const glm::dvec2& place) const;

  SkyOrientation orientation_;
  std::shared_ptr<const Image> map_;
  std::vector<double> sines_;   // of each row's middle: its solid angle, up to a factor
  std::vector<double> rows_;    // weight of all rows up to and including this
  std::vector<float> columns_;  // within a row, the share up to and including this pixel
};

}  // namespace ptc
