#include "engine/shade/reference/lobe_rays.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "engine/base/basis.h"

namespace ptc {
namespace {

constexpr float kLeastCosine = 1e-6F;

/// Returns Smith's ratio of hidden to visible facets for a direction at a cosine to the normal.
float hidden_ratio(float cosine, float alpha) {
  const float c = std::max(cosine, kLeastCosine);
  const float tangent2 = (1 - c * c) / (c * c);
  return 0.5F * (std::sqrt(1 + alpha * alpha * std::max(0.0F, tangent2)) - 1);
}

/// Returns the normal of a facet that the eye sees, in axes whose third is the surface's normal.
/// @param eye    unit, above the surface
/// @param point  of the unit square
glm::vec3 visible_facet(const glm::vec3& eye, float alpha, const glm::vec2& point) {
  // Stretch the facets to a hemisphere, choose a place on it as the eye sees it, and stretch back
  const glm::vec3 stretched =
      glm::normalize(glm::vec3(alpha * eye.x, alpha * eye.y, std::max(eye.z, kLeastCosine)));
  const float across = stretched.x * stretched.x + stretched.y * stretched.y;
  const glm::vec3 x = across > 0 ? glm::vec3(-stretched.y, stretched.x, 0) * (1 / std::sqrt(across))
                                 : glm::vec3(1, 0, 0);
  const glm::vec3 y = glm::cross(stretched, x);
  glm::vec2 place = concentric(point);
  const float upper = 0.5F * (1 + stretched.z);
  place.y = (1 - upper) * std::sqrt(std::max(0.0F, 1 - place.x * place.x)) + upper * place.y;
  const glm::vec3 facet =
      x * place.x + y * place.y + stretched * std::sqrt(std::max(0.0F, 1 - glm::dot(place, place)));
  return glm::normalize(
      glm::vec3(alpha * facet.x, alpha * facet.y, std::max(facet.z, kLeastCosine)));
}

}  // namespace

void lobe_directions(const glm::vec3& normal, const glm::vec3& to_eye, float roughness,
                     std::size_t count, std::uint64_t seed, LobeRays& lobe) {
  lobe.directions.clear();
  lobe.weights.clear();
  lobe.drawn = count;
  const Basis basis(normal);
  const glm::vec3 eye(glm::dot(basis.x, to_eye), glm::dot(basis.y, to_eye),
                      glm::dot(basis.z, to_eye));
  if (!(eye.z > 0)) return;
  const float alpha = roughness * roughness, hidden = hidden_ratio(eye.z, alpha);
  thread_local std::vector<glm::vec2> points;
  curve_points(count, seed, points);
  for (const glm::vec2& point : points) {
    const glm::vec3 facet = visible_facet(eye, alpha, point);
    const glm::vec3 along = 2 * glm::dot(eye, facet) * facet - eye;
    if (!(along.z > 0)) continue;  // light that meets further facets counts as lost
    lobe.directions.push_back(glm::normalize(basis.to_world(along)));
    lobe.weights.push_back((1 + hidden) / (1 + hidden + hidden_ratio(along.z, alpha)));
  }
}

Reflection sum_lobe(const LobeRays& lobe, std::span<const DiscHit> hits,
                    const std::function<glm::vec3(const glm::vec3&)>& sky) {
  double covered = 0, all = 0;
  glm::dvec3 light(0);
  for (std::size_t i = 0; i < lobe.directions.size(); ++i) {
    const auto weight = static_cast<double>(lobe.weights[i]);
    all += weight;
    if (hits[i].met()) {
      covered += weight;
      light += weight * glm::dvec3(hits[i].radiance);
    } else if (sky) {
      light += weight * glm::dvec3(sky(lobe.directions[i]));
    }
  }
  if (!(all > 0)) return {};
  return {.radiance = glm::vec3(light / static_cast<double>(lobe.drawn)),
          .occlusion = static_cast<float>(covered / all)};
}

}  // namespace ptc
