#include "engine/trace/ray_shader.h"

#include <algorithm>
#include <numeric>

#include "engine/shade/gather/receiver_cell.h"
#include "engine/shade/reference/cosine_rays.h"

namespace ptc {
namespace {

std::unique_ptr<PageCache> make_cache(const ContainerReader& scene, const RayOptions& options,
                                      unsigned threads) {
  const std::uint64_t least = PageCache::min_bytes(scene, threads, options.back_end),
                      decoded = threads * DiscTracer::kBytes;
  const std::uint64_t left = options.memory_bytes - std::min(options.memory_bytes, decoded);
  return std::make_unique<PageCache>(scene, CacheOptions{.memory_bytes = std::max(least, left),
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

void RayShader::trace(std::span<const Receiver> receivers, unsigned rays, std::uint64_t seed,
                      std::span<Shading> results, Progress& progress) {
  // Take receivers along the Z-curve, so that neighbours find each other's pages
  std::vector<MortonKey> keys(receivers.size());
  std::ranges::transform(receivers, keys.begin(), [&](const Receiver& receiver) {
    return receiver_key(view_.frame(), receiver.position, 0);
  });
  std::vector<std::size_t> along(receivers.size());
  std::iota(along.begin(), along.end(), std::size_t{0});
  std::ranges::stable_sort(along, {}, [&](std::size_t i) { return keys[i]; });
  const RaysFor wanted = options_.bleeding ? RaysFor::nearest : RaysFor::any;

  executor_.for_each(along.size(), [&](std::size_t place, unsigned thread) {
    // Let the rays of a receiver meet the scene
    const std::size_t index = along[place];
    const Receiver& receiver = receivers[index];
    Worker& own = worker(thread);
    cosine_directions(receiver.normal, rays, seed + index, own.directions);
    own.hits.assign(rays, RayHit{});
    own.tracer.begin(receiver.position, receiver.normal);
    own.tracer.meet(own.directions, wanted, own.hits);
    // Sum up what they see
    own.seen.assign(rays, DiscHit{});
    for (std::size_t i = 0; i < rays; ++i) {
      const RayHit& hit = own.hits[i];
      if (hit.met())
        own.seen[i] = {hit.depth, options_.bleeding ? own.tracer.radiance(hit, options_.emission)
                                                    : glm::vec3(0)};
    }
    results[index] = sum_rays(receiver, own.directions, own.seen, options_.sky);
    progress.advance(1);
  });
}

}  // namespace ptc
