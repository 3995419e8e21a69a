#include "engine/pipeline/light/disc_light.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/io/cloud/record.h"
#include "engine/pipeline/scene_record.h"
#include "engine/shade/lift.h"
#include "engine/store/container_points.h"

namespace ptc {
namespace {

constexpr float kLeastLift = 0.15F;       // of emitters, where rays end
constexpr std::size_t kNeighbours = 64;   // surfels whose rays are traced together
constexpr std::size_t kRays = 8192;       // that are traced at the latest when there are so many
constexpr float kQuarter = 0.353553391F;  // of the edge of the square that a disc of radius 1 has

/// Returns the rays of each place of a surfel, rounded up.
unsigned share(unsigned rays, unsigned places) {
  return (rays + places - 1) / places;
}

/// Returns the place of a quarter of a surfel's cell, relative to its centre, scene units.
glm::vec3 quarter(const Surfel& surfel, const Basis& basis, unsigned place) {
  const float step = kQuarter * surfel.radius;
  return basis.x * ((place & 1) != 0 ? step : -step) + basis.y * ((place & 2) != 0 ? step : -step);
}

/// Calls visit(point) for each point of a container that emits.
template <class Visit>
void for_each_emitting(const ContainerReader& container, const Visit& visit) {
  if (!may_emit(container)) return;
  ContainerPoints points(container);
  std::vector<PointRecord> block(DiscLight::kBlock);
  while (const std::size_t count = points.next(block)) {
    for (std::size_t i = 0; i < count; ++i) {
      if (block[i].emission != Half3{} && block[i].radius > 0) visit(block[i]);
    }
  }
}

}  // namespace

/// What a thread needs.
struct DiscLight::Worker {
  Worker(const SceneView& view, PageCache& cache, Sides sides) : tracer(view, cache, sides) {}

  ShadowTracer tracer;
  std::vector<LightRay> drawn;         ///< of a place
  std::vector<ShadowRay> rays;         ///< of neighbours
  std::vector<glm::vec3> brings;       ///< irradiance of each ray
  std::vector<std::uint32_t> surfels;  ///< the surfel of each ray
  std::vector<std::uint8_t> hidden;    ///< for each ray
  std::uint64_t count = 0;             ///< rays so far

  /// Adds what the rays bring that nothing hides, and what all bring, and forgets them.
  void bring(std::span<glm::vec3> out, std::span<glm::vec3> open) {
    hidden.resize(rays.size());
    tracer.test(rays, hidden);
    count += rays.size();
    for (std::size_t ray = 0; ray < rays.size(); ++ray) {
      if (hidden[ray] == 0) out[surfels[ray]] += brings[ray];
      if (!open.empty()) open[surfels[ray]] += brings[ray];
    }
    rays.clear();
    brings.clear();
    surfels.clear();
  }
};

DiscLight::DiscLight(const SceneView& view, PageCache& cache, const LightRays& rays,
                     const LightSampling& sampling, unsigned places, Sides sides,
                     const Executor& executor)
    : view_(view),
      cache_(cache),
      rays_(rays),
      places_(places),
      sampling_{.sun_rays = share(sampling.sun_rays, places),
                .area_rays = share(sampling.area_rays, places)},
      sides_(sides),
      executor_(executor),
      workers_(executor.threads()) {}

DiscLight::~DiscLight() = default;

std::uint64_t DiscLight::thread_bytes(const LightRig& rig, const LightSampling& sampling,
                                      unsigned places) noexcept {
  const std::uint64_t place = rig.suns.size() * std::uint64_t{share(sampling.sun_rays, places)} +
                              rig.points.size() + rig.spots.size() +
                              share(sampling.area_rays, places);
  // A ray takes a LightRay, and some 60 bytes until it is traced. Vectors that grow take twice as
  // much
  return ShadowTracer::kBytes + 2 * (kRays + place) * (sizeof(LightRay) + 64);
}

std::uint64_t DiscLight::rays() const noexcept {
  std::uint64_t sum = 0;
  for (const auto& worker : workers_) sum += worker ? worker->count : 0;
  return sum;
}

void DiscLight::light_block(Worker& own, std::span<const Surfel> surfels,
                            std::span<const float> heights, std::uint64_t first,
                            std::span<glm::vec3> out, std::span<glm::vec3> open) const {
  // Trace around the middle of the block
  Bounds bounds;
  for (const Surfel& surfel : surfels) bounds.add(surfel.position);
  const glm::dvec3 middle = 0.5 * bounds.low + 0.5 * bounds.high;
  const SceneScale& scale = view_.scale();
  own.tracer.begin(middle);
  for (std::size_t from = 0; from < surfels.size(); from += kNeighbours) {
    // Draw the rays of some neighbours, and trace them
    const std::size_t to = std::min(from + kNeighbours, surfels.size());
    for (std::size_t i = from; i < to; ++i) {
      const Surfel& surfel = surfels[i];
      out[i] = glm::vec3(0);
      if (!open.empty()) open[i] = glm::vec3(0);
      if (!(surfel.radius > 0)) continue;
      const Basis basis(surfel.normal);
      for (unsigned place = 0; place < places_; ++place) {
        const glm::vec3 aside = places_ == 1 ? glm::vec3(0) : quarter(surfel, basis, place);
        const glm::dvec3 position = surfel.position + glm::dvec3(aside);
        const glm::dvec3 start = position + glm::dvec3(surfel.normal * heights[i]);
        const glm::vec3 origin = scale.way(middle, start);
        rays_.draw(position, surfel.normal, sampling_, first + i, place, own.drawn);
        for (const LightRay& ray : own.drawn) {
          ShadowRay shadow{.origin = origin, .direction = ray.direction};
          if (ray.ends) {
            const glm::dvec3 way = ray.end - start;
            const double distance = glm::length(way);
            if (!(distance > 0)) continue;
            shadow.direction = glm::vec3(way / distance);
            shadow.length = static_cast<float>(std::min(scale.length(distance), 0x1p100));
          }
          own.rays.push_back(shadow);
          own.brings.push_back(ray.irradiance / static_cast<float>(places_));
          own.surfels.push_back(static_cast<std::uint32_t>(i));
        }
        if (own.rays.size() >= kRays) own.bring(out, open);
      }
    }
    own.bring(out, open);
  }
}

void DiscLight::irradiance(std::span<const Surfel> surfels, std::span<const float> heights,
                           std::uint64_t first, std::span<glm::vec3> out,
                           std::span<glm::vec3> open) {
  const std::size_t blocks = (surfels.size() + kBlock - 1) / kBlock;
  executor_.for_each(blocks, [&](std::size_t block, unsigned thread) {
    if (!workers_[thread]) workers_[thread] = std::make_unique<Worker>(view_, cache_, sides_);
    const std::size_t from = block * kBlock, count = std::min(kBlock, surfels.size() - from);
    light_block(*workers_[thread], surfels.subspan(from, count), heights.subspan(from, count),
                first + from, out.subspan(from, count),
                open.empty() ? open : open.subspan(from, count));
  });
}

Emitting count_emitting(const ContainerReader& container) {
  Emitting emitting;
  for_each_emitting(container, [&](const PointRecord& point) {
    ++emitting.count;
    emitting.area += 2 * double{point.radius} * double{point.radius};
  });
  return emitting;
}

LightRays rays_at_lights(const ContainerReader& container, const LightRig& rig, float lift,
                         std::uint64_t count) {
  const auto& low = container.superblock().bounds_low;
  const glm::dvec3 origin(low[0], low[1], low[2]);
  const Frame& frame = container.header().frame;
  std::vector<Emitter> emitters;
  emitters.reserve(2 * count);
  const auto add = [&](const PointRecord& point) {
    const Surfel surfel = to_surfel(point, frame);
    const Basis basis(surfel.normal);
    const glm::vec3 centre(lifted(surfel, std::max(lift, kLeastLift), frame).position - origin);
    // The corners of its cell lie on the rim of the disc
    const glm::vec3 a = basis.x * surfel.radius, b = basis.y * surfel.radius;
    emitters.push_back({{centre + a, centre + b, centre - a}, surfel.emission});
    emitters.push_back({{centre - a, centre - b, centre + a}, surfel.emission});
  };
  if (count > 0) for_each_emitting(container, add);
  return {rig, std::move(emitters), origin, 0};
}

}  // namespace ptc
