// The rays that shade a receiver, whatever traces them: their directions, and the sums over them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/shading.h"

namespace ptc {

/// The nearest disc that a ray has met.
struct DiscHit {
  /// Bumped depth along the ray (spec/shading.md#surfels), in edges of the frame.
  float depth = std::numeric_limits<float>::infinity();
  glm::vec3 radiance{0};  ///< of the side of the disc that the ray met, W/(m^2 sr)

  /// Reports whether the ray met a disc.
  [[nodiscard]] bool met() const noexcept { return depth < std::numeric_limits<float>::infinity(); }
};

/// Makes cosine-distributed directions above a normal: points of SquarePoints, taken to the disc by
/// the concentric map of Shirley and Chiu 1997. They are in the order of a Hilbert curve of the
/// square, so that neighbours in the list have neighbouring directions. The same seed gives the
/// same directions.
/// @param count       number of directions
/// @param directions  receives them
void cosine_directions(const glm::vec3& normal, std::size_t count, std::uint64_t seed,
                       std::vector<glm::vec3>& directions);

/// Sums up what the rays of a receiver have met.
/// @param directions  of cosine_directions()
/// @param hits        one for each direction
/// @param sky         radiance that arrives from a direction (unit); empty where there is no sky
[[nodiscard]] Shading sum_rays(const Receiver& receiver, std::span<const glm::vec3> directions,
                               std::span<const DiscHit> hits,
                               const std::function<glm::vec3(const glm::vec3&)>& sky);

}  // namespace ptc
