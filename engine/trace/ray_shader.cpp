#include "engine/trace/ray_shader.h"

#include <algorithm>
#include <numeric>

#include <glm/geometric.hpp>

#include "engine/shade/gather/receiver_cell.h"
#include "engine/shade/reference/cosine_rays.h"
#include "engine/shade/reference/lobe_rays.h"

namespace ptc {
namespace {

std::unique_ptr<PageCache> make_cache(const ContainerReader& scene, const RayOptions& options,
                                      unsigned threads) {
  const std::uint64_t least = RayShader::least_bytes(scene, threads, options.back_end),
                      decoded = threads * DiscTracer::kBytes;
  return std::make_unique<PageCache>(
      scene, CacheOptions{.memory_bytes = std::max(least, options.memory_bytes) - decoded,
                          .threads = threads,
                          .back_end = options.back_end});
}

}  // namespace

RayOptions ray_options(const ShadeOptions& options) {
  return {.sides = options.gather.sides,
          .sky = options.sky,
          .bleeding = options.gather.bleeding,
          .emission = options.gather.emission,
          .memory_bytes = options.cache_bytes,
          .back_end = options.back_end};
}

/// What a thread needs.
struct RayShader::Worker {
  DiscTracer tracer;
  std::vector<glm::vec3> directions;
  LobeRays lobe;
  std::vector<RayHit> hits;
  std::vector<DiscHit> seen;
};

RayShader::RayShader(const ContainerReader& scene, const RayOptions& options,
                     const Executor& executor)
    : executor_(executor),
      view_(scene),
      options_(options),
      cache_(make_cache(scene, options, executor.threads())),
      workers_(executor.threads()) {}

RayShader::~RayShader() = default;

RayShader::Worker& RayShader::worker(unsigned thread) {
  if (!workers_[thread])
    workers_[thread].reset(new Worker{.tracer = DiscTracer(view_, *cache_, options_.sides)});
  return *workers_[thread];
}

CacheStatistics RayShader::cache_statistics() {
  for (auto& own : workers_) own.reset();
  return cache_->statistics();
}

std::uint64_t RayShader::least_bytes(const ContainerReader& scene, unsigned threads,
                                     BackEnd back_end) {
  return PageCache::min_bytes(scene, threads, back_end) + threads * DiscTracer::kBytes;
}

template <class Body>
void RayShader::for_each_along(std::span<const Receiver> receivers, const Body& body) {
  // Take receivers along the Z-curve, so that neighbours find each other's pages
  std::vector<MortonKey> keys(receivers.size());
  std::ranges::transform(receivers, keys.begin(), [&](const Receiver& receiver) {
    return receiver_key(view_.frame(), receiver.position, 0);
  });
  std::vector<std::size_t> along(receivers.size());
  std::iota(along.begin(), along.end(), std::size_t{0});
  std::ranges::stable_sort(along, {}, [&](std::size_t i) { return keys[i]; });
  executor_.for_each(along.size(), [&](std::size_t place, unsigned thread) {
    body(along[place], worker(thread));
  });
}

void RayShader::look(Worker& own, const Receiver& receiver, std::span<const glm::vec3> directions,
                     bool emission) const {
  own.hits.assign(directions.size(), RayHit{});
  own.tracer.begin(receiver.position, receiver.normal);
  own.tracer.meet(directions, options_.bleeding ? RaysFor::nearest : RaysFor::any, own.hits);
  own.seen.assign(directions.size(), DiscHit{});
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const RayHit& hit = own.hits[i];
    if (!hit.met()) continue;
    own.seen[i] = {hit.depth,
                   options_.bleeding ? own.tracer.radiance(hit, emission) : glm::vec3(0)};
  }
}

void RayShader::trace(std::span<const Receiver> receivers, unsigned rays, std::uint64_t seed,
                      std::span<Shading> results, Progress& progress) {
  for_each_along(receivers, [&](std::size_t i, Worker& own) {
    cosine_directions(receivers[i].normal, rays, seed + i, own.directions);
    look(own, receivers[i], own.directions, options_.emission);
    results[i] = sum_rays(receivers[i], own.directions, own.seen, options_.sky);
    progress.advance(1);
  });
}

void RayShader::reflect(std::span<const Receiver> receivers, const Mirrors& mirrors,
                        std::uint64_t seed, std::span<Reflection> results) {
  const unsigned rays = mirrors.roughness > 0 ? mirrors.rays : 1;
  for_each_along(receivers, [&](std::size_t i, Worker& own) {
    const glm::dvec3 way = mirrors.eye - receivers[i].position;
    const double distance = glm::length(way);
    const glm::vec3 to_eye = distance > 0 ? glm::vec3(way / distance) : glm::vec3(0);
    lobe_directions(receivers[i].normal, to_eye, mirrors.roughness, rays, seed + i, own.lobe);
    look(own, receivers[i], own.lobe.directions, true);
    results[i] = sum_lobe(own.lobe, own.seen, options_.sky);
  });
}

}  // namespace ptc
