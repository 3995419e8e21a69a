#include "engine/trace/shadow_tracer.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include <glm/geometric.hpp>

#include "engine/base/basis.h"

namespace ptc {
namespace {

constexpr std::size_t kFewRays = 8;  // for which a walk for the beam does not pay
// Least cosine between a ray and the axis of its beam: beyond, the beam would be wider than deep.
constexpr float kLeastCosine = 0.7F;
constexpr unsigned kKeyBits = 4;  // of each coordinate by which rays are ordered

/// Returns a number that is the same for rays of about the same direction, and near for near ones.
std::uint32_t direction_key(const glm::vec3& d) {
  // Unfold the octahedron to a square
  const float sum = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
  float u = d.x / sum, v = d.y / sum;
  if (d.z < 0) {
    const float folded = (1 - std::abs(v)) * (u < 0 ? -1.0F : 1.0F);
    v = (1 - std::abs(u)) * (v < 0 ? -1.0F : 1.0F);
    u = folded;
  }
  constexpr float kCells = 1U << kKeyBits;
  const auto cell = [&](float x) {
    return static_cast<std::uint32_t>(std::clamp(0.5F * (x + 1) * kCells, 0.0F, kCells - 1));
  };
  // Put the cells on a Z-curve
  std::uint32_t key = 0;
  for (unsigned bit = 0; bit < kKeyBits; ++bit)
    key |= (cell(u) >> bit & 1) << 2 * bit | (cell(v) >> bit & 1) << (2 * bit + 1);
  return key;
}

/// Returns the shaft around rays; nothing when their directions differ too much.
std::optional<Shaft> shaft_around(std::span<const ShadowRay> rays,
                                  std::span<const std::uint32_t> beam) {
  glm::vec3 sum(0);
  for (const std::uint32_t i : beam) sum += rays[i].direction;
  const float length = glm::length(sum);
  if (!(length > 0)) return std::nullopt;
  const Basis basis(sum / length);
  constexpr float kNone = std::numeric_limits<float>::infinity();
  Shaft shaft{.axes = {basis.to_world({1, 0, 0}), basis.to_world({0, 1, 0}), sum / length},
              .low = {kNone, kNone, kNone},
              .high = {-kNone, -kNone, -kNone},
              .slope_low = {kNone, kNone},
              .slope_high = {-kNone, -kNone},
              .depth = 0};
  for (const std::uint32_t i : beam) {
    const ShadowRay& ray = rays[i];
    const float along = glm::dot(ray.direction, shaft.axes[2]);
    if (!(along >= kLeastCosine)) return std::nullopt;
    for (int k = 0; k < 3; ++k) {
      const float at = glm::dot(ray.origin, shaft.axes[k]);
      shaft.low[k] = std::min(shaft.low[k], at);
      shaft.high[k] = std::max(shaft.high[k], at);
    }
    for (int k = 0; k < 2; ++k) {
      const float slope = glm::dot(ray.direction, shaft.axes[k]) / along;
      shaft.slope_low[k] = std::min(shaft.slope_low[k], slope);
      shaft.slope_high[k] = std::max(shaft.slope_high[k], slope);
    }
    shaft.depth = std::max(shaft.depth, ray.length);
  }
  // Widen it by what rounding may take from it
  constexpr float kRound = 4e-6F;
  float size = 0;
  for (int k = 0; k < 3; ++k)
    size = std::max({size, std::abs(shaft.low[k]), std::abs(shaft.high[k])});
  for (int k = 0; k < 3; ++k) {
    shaft.low[k] -= kRound * size;
    shaft.high[k] += kRound * size;
  }
  for (int k = 0; k < 2; ++k) {
    shaft.slope_low[k] -= kRound;
    shaft.slope_high[k] += kRound;
  }
  return shaft;
}

}  // namespace

ShadowTracer::ShadowTracer(const SceneView& view, PageCache& cache, Sides sides)
    : tree_(view, cache, clear_backs(sides), kRim) {}

void ShadowTracer::trace_beam(std::span<const ShadowRay> rays, std::span<const std::uint32_t> beam,
                              std::span<std::uint8_t> hidden) {
  const std::optional<Shaft> shaft =
      beam.size() > kFewRays ? shaft_around(rays, beam) : std::nullopt;
  if (shaft) {
    list_.list_along(tree_, place_, *shaft, 0);
  } else {
    list_.list_root(tree_);
  }
  trace_shadows(tree_, place_, list_.boxes(), list_.words(), rays, beam, hidden);
}

void ShadowTracer::test(std::span<const ShadowRay> rays, std::span<std::uint8_t> hidden) {
  // Order the rays by direction; rays of one key stay as they are, neighbours side by side
  keys_.resize(rays.size());
  std::ranges::transform(rays, keys_.begin(),
                         [](const ShadowRay& ray) { return direction_key(ray.direction); });
  order_.resize(rays.size());
  std::iota(order_.begin(), order_.end(), 0U);
  std::ranges::stable_sort(order_, {}, [&](std::uint32_t i) { return keys_[i]; });
  // Cut them into beams
  for (std::size_t from = 0; from < order_.size();) {
    std::size_t to = from + 1;
    const glm::vec3& first = rays[order_[from]].direction;
    while (to < order_.size() && to < from + kBeam &&
           glm::dot(rays[order_[to]].direction, first) > kLeastCosine) {
      ++to;
    }
    trace_beam(rays, std::span(order_).subspan(from, to - from), hidden);
    from = to;
  }
}

}  // namespace ptc
