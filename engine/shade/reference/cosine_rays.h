// The rays that shade a receiver, whatever traces them: their directions, and the sums over them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
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

/// Makes points of SquarePoints in the order of a Hilbert curve of the square, so that neighbours
/// in the list lie close together. The same seed gives the same points.
/// @param points  receives them
void curve_points(std::size_t count, std::uint64_t seed, std::vector<glm::vec2>& points);

/// Takes a point of the unit square to the unit disc, and areas to areas. Squares about the middle
/// become circles: the greater coordinate is the distance from the centre, and their ratio the
/// place on an eighth of the circle. Source: Shirley and Chiu 1997, A low distortion map between
/// disk and square.
[[nodiscard]] glm::vec2 concentric(const glm::vec2& point);

/// Makes cosine-distributed directions above a normal: curve_points(), whose concentric() places
/// are those of the directions seen from above. Neighbours in the list have neighbouring
/// directions.
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
