// Oracles for the gather: every surfel counts, and no cluster stands for it.
//
//     mesh ---------> discs ------------------> brute force ------------------> gather
//     trace_mesh()    DiscRays                  shade_brute_force()             Gather
//
//          surfels             direction pixels              clusters, sharing
//
// Each arrow adds the error of what stands below it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/cache/page_cache.h"
#include "engine/shade/gather/direction_buffer.h"
#include "engine/shade/reference/cosine_rays.h"

namespace ptc {

/// Reads and decodes all surfels of a container.
/// @param limit  maximum number of points, so that a reference run on a city keeps within memory
/// @throws RequestError above that number; FormatError when a page is damaged
[[nodiscard]] std::vector<Surfel> load_surfels(const ContainerReader& container,
                                               std::uint64_t limit);

/// Appends the surfels of some point pages of a container.
/// @param pages  numbers of point pages
/// @throws FormatError when a page is damaged
void append_surfels(const ContainerReader& container, PageNumbers::Range pages,
                    std::vector<Surfel>& surfels);

/// Shades receivers without a hierarchy: every surfel is drawn as an exact disc for every receiver.
/// What is left against rays is the error of direction pixels.
///
/// Time: receivers x surfels.
/// @param results  as many as receivers, in their order
void shade_brute_force(std::span<const Surfel> surfels, std::span<const Receiver> receivers,
                       std::span<Shading> results, const DirectionGrid& grid, Sides sides,
                       const Executor& executor);

/// Embree rays at the discs that a gather approximates: the reference for the gather's own error.
///
/// Where discs overlap they divide as in DirectionBuffer::draw(), and their back sides follow the
/// same rule.
/// Memory: at most kBytes for each surfel.   Threads: const members may be called concurrently.
class DiscRays {
 public:
  /// Maximum memory for each surfel while the tree is built, bytes.
  static constexpr std::uint64_t kBytes = 200;

  /// Builds Embree's tree over the discs.
  /// @param surfels  must outlive this
  /// @param sides    which sides stop rays
  /// @param sky      radiance that arrives from a direction (unit); empty where there is no sky
  /// @throws std::bad_alloc; std::runtime_error when Embree has no device
  DiscRays(std::span<const Surfel> surfels, Sides sides,
           std::function<glm::vec3(const glm::vec3&)> sky);
  ~DiscRays();

  /// Traces stratified cosine rays from a receiver. The result is deterministic in `seed`.
  /// @param rays  number of rays, best a power of 4
  [[nodiscard]] Shading trace(const Receiver& receiver, unsigned rays, std::uint64_t seed) const;
  /// Finds what rays from a place meet.
  /// @param position    scene units
  /// @param directions  unit
  /// @param hits        as many as directions
  void meet(const glm::dvec3& position, std::span<const glm::vec3> directions,
            std::span<DiscHit> hits) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
