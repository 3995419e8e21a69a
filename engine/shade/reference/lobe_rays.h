// The rays by which a rough mirror sees its surroundings, and the sums over them
// (spec/shading.md#glossy).
//
//      eye   n   . - mirror direction
//         \  |  / .
//          \ | / / .     the lobe: directions into which facets of the surface reflect the eye
//           \|/. '
//     -------x-------
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/reference/cosine_rays.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Directions of a lobe, and how much each counts.
struct LobeRays {
  std::vector<glm::vec3> directions;  ///< unit, above the surface; neighbours are alike
  std::vector<float> weights;         ///< share of the light that is not lost between facets
  std::size_t drawn = 0;              ///< number of directions with those below the horizon
};

/// Draws directions into which a surface of GGX facets reflects an eye: facets by how much of each
/// the eye sees. The same seed gives the same directions.
/// Source: Walter et al. 2007; Heitz 2014, height-correlated masking and shadowing; Heitz 2018,
/// Sampling the GGX distribution of visible normals.
/// @param normal     unit
/// @param to_eye     unit; below the surface there is no direction
/// @param roughness  0 to 1; its square is the width alpha of the distribution
/// @param count      number of directions to draw
void lobe_directions(const glm::vec3& normal, const glm::vec3& to_eye, float roughness,
                     std::size_t count, std::uint64_t seed, LobeRays& lobe);

/// Sums up what the rays of a lobe have met.
/// @param hits  one for each of its directions
/// @param sky   radiance that arrives from a direction (unit); empty where there is no sky
[[nodiscard]] Reflection sum_lobe(const LobeRays& lobe, std::span<const DiscHit> hits,
                                  const std::function<glm::vec3(const glm::vec3&)>& sky);

}  // namespace ptc
