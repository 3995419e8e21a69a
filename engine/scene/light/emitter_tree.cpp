#include "engine/scene/light/emitter_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace ptc {
namespace {

// Cosines count as this much at least: bounds near a horizon are coarse, and a draw that is too
// rare brings too much
constexpr double kLeastCosine = 0.05;
// What a node gives from its middle tells two halves of a wide lamp apart, but not those of
// scattered ones: this share of the bound is added to it (spec/notes/relighting.md#many-emitters)
constexpr double kBoundShare = 0.2;
constexpr double kMargin = 1e-6;         // of bounds, for what floats round away
constexpr double kLeastSquare = 1e-300;  // of a distance
constexpr double kBelowOne = 1 - 0x1p-53;

glm::dvec3 middle_of(const Emitter& emitter) {
  return (glm::dvec3(emitter.corner[0]) + glm::dvec3(emitter.corner[1]) +
          glm::dvec3(emitter.corner[2])) /
         3.0;
}

/// Returns the cosine of the angle a less the angle b, 1 where that is below 0; both 0 to pi.
double cosine_less(double cos_a, double cos_b) {
  if (cos_a >= cos_b) return 1;
  return cos_a * cos_b +
         std::sqrt(std::max(0.0, 1 - cos_a * cos_a) * std::max(0.0, 1 - cos_b * cos_b));
}

}  // namespace

EmitterTree::EmitterTree(std::vector<Emitter>& emitters) {
  if (!emitters.empty()) add(emitters, 0, static_cast<std::uint32_t>(emitters.size()));
}

void EmitterTree::add(std::span<Emitter> emitters, std::uint32_t first, std::uint32_t end) {
  // Sum up the emitters
  const auto some = emitters.subspan(first, end - first);
  glm::dvec3 low(std::numeric_limits<double>::max()), high(-low), axis(0), centre(0);
  double power = 0;
  for (const Emitter& emitter : some) {
    const glm::dvec3 middle = middle_of(emitter);
    const double own = power_of(emitter);
    power += own;
    axis += twice_area_of(emitter) * brightness(emitter.radiance);
    centre += middle * own;
    low = glm::min(low, middle);
    high = glm::max(high, middle);
  }
  Node node{.centre = glm::vec3(centre / power), .power = power, .first = first, .end = end};
  const double length = glm::length(axis);
  axis = length > 0 ? axis / length : glm::dvec3(0, 0, 1);
  node.axis = glm::vec3(axis);
  double radius = 0, cone = 1, spread = 0;
  for (const Emitter& emitter : some) {
    const glm::dvec3 area = twice_area_of(emitter);
    const double share = power_of(emitter) / (3 * power);
    cone = std::min(cone, glm::dot(axis, area) / glm::length(area));
    for (const glm::vec3& corner : emitter.corner) {
      const glm::dvec3 way = glm::dvec3(corner) - glm::dvec3(node.centre);
      radius = std::max(radius, glm::length(way));
      spread += share * glm::dot(way, way);
    }
  }
  // Rounding must not leave out what may just give light
  node.radius = static_cast<float>(radius * (1 + kMargin));
  node.spread = static_cast<float>(std::sqrt(spread));
  node.cone = static_cast<float>(cone - kMargin);
  const std::size_t at = nodes_.size();
  nodes_.push_back(node);
  if (some.size() <= kLeaf) return;
  // Halve them across their longest side
  const glm::dvec3 side = high - low;
  const int across = side.x >= side.y && side.x >= side.z ? 0 : side.y >= side.z ? 1 : 2;
  const std::uint32_t middle = first + (end - first) / 2;
  std::ranges::nth_element(some, some.begin() + (middle - first), {},
                           [&](const Emitter& emitter) { return middle_of(emitter)[across]; });
  add(emitters, first, middle);
  nodes_[at].second = static_cast<std::uint32_t>(nodes_.size());
  add(emitters, middle, end);
}

double EmitterTree::expected(const Node& node, const glm::vec3& position, const glm::vec3& normal) {
  const glm::dvec3 way = glm::dvec3(node.centre) - glm::dvec3(position);
  const double square = glm::dot(way, way), radius = static_cast<double>(node.radius),
               spread = static_cast<double>(node.spread);
  const double distance = std::sqrt(std::max(square, kLeastSquare));
  const double facing = glm::dot(glm::dvec3(normal), way) / distance;
  const double turned =
      cosine_less(-glm::dot(glm::dvec3(node.axis), way) / distance, static_cast<double>(node.cone));
  // At the middle
  const double middle = std::max(facing, 0.0) * std::max(turned, 0.0) /
                        std::max(square + spread * spread, kLeastSquare);
  // At most: from within the sphere any emitter may lie in any direction
  double most = 1 / std::max(radius * radius, kLeastSquare);
  if (square > radius * radius) {
    const double sphere = std::sqrt(1 - radius * radius / square);  // cosine of its half angle
    const double here = cosine_less(facing, sphere), there = cosine_less(turned, sphere);
    if (here <= 0 || there <= 0) return 0;
    most = std::max(here, kLeastCosine) * std::max(there, kLeastCosine) /
           std::max(square, kLeastSquare);
  }
  return node.power * (middle + kBoundShare * most);
}

EmitterTree::Drawn EmitterTree::draw(const glm::vec3& position, const glm::vec3& normal,
                                     double unit) const {
  if (nodes_.empty() || !(expected(nodes_[0], position, normal) > 0)) return {};
  Drawn drawn{.rest = unit};
  std::size_t at = 0;
  while (nodes_[at].second != 0) {
    const std::size_t second = nodes_[at].second;
    const double a = expected(nodes_[at + 1], position, normal),
                 b = expected(nodes_[second], position, normal);
    if (!(a + b > 0)) return {};
    const double share = a / (a + b);
    if (drawn.rest < share) {
      at = at + 1;
      drawn.chance *= share;
      drawn.rest = std::min(drawn.rest / share, kBelowOne);
    } else {
      at = second;
      drawn.chance *= 1 - share;
      drawn.rest = std::min((drawn.rest - share) / (1 - share), kBelowOne);
    }
  }
  drawn.first = nodes_[at].first;
  drawn.end = nodes_[at].end;
  return drawn;
}

}  // namespace ptc
