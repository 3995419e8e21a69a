// Oracles: every surfel counts, no cluster stands for it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/shade/direction_buffer.h"
#include "engine/cache/page_cache.h"

namespace ptc {

/// All surfels of a container, decoded. @throws std::length_error above `limit` points, so that a
/// reference run on a city does not exhaust memory.
[[nodiscard]] std::vector<Surfel> load_surfels(const ContainerReader& container, std::uint64_t limit);

/// The gather without hierarchy: every surfel is drawn as an exact disc for every receiver. What is
/// left against rays is the error of direction pixels.   Time: receivers x surfels.
void shade_brute_force(std::span<const Surfel> surfels, std::span<const Receiver> receivers,
                       std::span<Shading> results, const DirectionGrid& grid, Sides sides,
                       const Executor& executor);

/// Embree rays at the same discs: the reference for the gather's own error.
///
/// The discs divide where they overlap as in DirectionBuffer::draw(), and their back sides
/// follow the same rule. Threads: trace() may be called concurrently. Memory: about 100 bytes a surfel.
class DiscRays {
 public:
  DiscRays(std::span<const Surfel> surfels, Sides sides, std::function<glm::vec3(const glm::vec3&)> sky);
  ~DiscRays();

  /// @param rays  stratified cosine rays, rounded down to a square   Deterministic in `seed`.
  [[nodiscard]] Shading trace(const Receiver& receiver, unsigned rays, std::uint64_t seed) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
