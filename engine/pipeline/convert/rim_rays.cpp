#include "engine/pipeline/convert/rim_rays.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/base/basis.h"
#include "engine/io/cloud/record.h"

namespace ptc {
namespace {

constexpr std::uint64_t kRimCacheBytes = std::uint64_t{16} << 20;  // of neighbouring pages

std::uint64_t cache_bytes(const ContainerReader& scene) {
  return std::max(kRimCacheBytes, PageCache::min_bytes(scene, 1, BackEnd::pread));
}

}  // namespace

std::uint64_t RimRays::least_bytes(const ContainerReader& scene) {
  return cache_bytes(scene) + ShadowTracer::kBytes;
}

RimRays::RimRays(const ContainerReader& scene)
    : scene_(scene),
      view_(scene),
      cache_(scene, {.memory_bytes = cache_bytes(scene), .threads = 1}),
      tracer_(view_, cache_, Sides::both) {}

bool RimRays::meet(const PointRecord& disc, float finest) {
  const Surfel surfel = to_surfel(disc, scene_.header().frame);
  const Basis basis(surfel.normal);
  const float half = kHalfLength * finest;
  const auto length = static_cast<float>(view_.scale().length(double{2 * half}));
  std::array<ShadowRay, kRays> rays;
  for (unsigned i = 0; i < kRays; ++i) {
    const float angle = 2 * std::numbers::pi_v<float> / kRays * static_cast<float>(i);
    const glm::vec3 start =
        kAt * surfel.radius * (std::cos(angle) * basis.x + std::sin(angle) * basis.y) +
        half * surfel.normal;
    rays[i] = {.origin = view_.scale().way(glm::dvec3(0), glm::dvec3(start)),
               .direction = -surfel.normal,
               .length = length};
  }
  std::array<std::uint8_t, kRays> hidden{};
  tracer_.begin(surfel.position);
  tracer_.test(rays, hidden);
  return std::ranges::all_of(hidden, [](std::uint8_t met) { return met != 0; });
}

}  // namespace ptc
