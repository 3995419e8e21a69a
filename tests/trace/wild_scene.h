// A scene that is hard for rays.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/base/surfel.h"

namespace ptc::test {

/// Discs of all sizes, turned at random, some of them at the same place.
inline std::vector<Surfel> wild_scene() {
  std::mt19937 bits(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Surfel> surfels;
  for (int i = 0; i < 4000; ++i) {
    Surfel s;
    s.position = {uniform(bits), uniform(bits), uniform(bits)};
    s.normal = glm::normalize(glm::vec3(uniform(bits), uniform(bits), uniform(bits) + 0.01));
    s.radius = static_cast<float>(0.1 * std::pow(2.0, 6 * uniform(bits) - 4));
    s.radiance = glm::vec3(0.1F * static_cast<float>(i % 11));
    for (int copies = i % 500 == 0 ? 40 : 1; copies > 0; --copies) surfels.push_back(s);
  }
  return surfels;
}

}  // namespace ptc::test
