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
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/cache/page_cache.h"
#include "engine/shade/gather/direction_buffer.h"
#include "engine/shade/scene_scale.h"

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

/// The nearest disc that a ray has met so far.
struct DiscHit {
  /// Bumped depth along the ray (spec/shading.md#surfels), in edges of the frame.
  float depth = std::numeric_limits<float>::infinity();
  glm::vec3 radiance{0};  ///< of the side of the disc that the ray met, W/(m^2 sr)

  /// Reports whether the ray met a disc.
  [[nodiscard]] bool met() const noexcept { return depth < std::numeric_limits<float>::infinity(); }
};

/// Embree rays at the discs that a gather approximates: the reference for the gather's own error.
///
/// Where discs overlap they divide as in DirectionBuffer::draw(), and their back sides follow the
/// same rule.
/// Memory: at most kBytes for each surfel.   Threads: const members may be called concurrently.
class DiscRays {
 public:
  /// Maximum memory for each surfel while the tree is built, bytes.
  static constexpr std::uint64_t kBytes = 200;

  /// The frame of the numbers that Embree is given, which must stay below 1.8e18.
  struct Space {
    glm::dvec3 origin{0};       ///< scene units; rays are exact relative to it
    SceneScale scale{Frame{}};  ///< unit of length
  };
  /// Builds Embree's tree over the discs.
  /// @param surfels  must outlive this
  /// @param sides    which sides stop rays
  /// @param sky      radiance that arrives from a direction (unit); empty where there is no sky
  /// @param space    when absent, the middle of the surfels and a frame around them
  /// @throws std::bad_alloc; std::runtime_error when Embree has no device
  DiscRays(std::span<const Surfel> surfels, Sides sides,
           std::function<glm::vec3(const glm::vec3&)> sky, const std::optional<Space>& space = {});
  ~DiscRays();

  /// Traces stratified cosine rays from a receiver. The result is deterministic in `seed`.
  /// @param rays  number of rays, rounded down to a square number
  [[nodiscard]] Shading trace(const Receiver& receiver, unsigned rays, std::uint64_t seed) const;

  /// Returns the side of the largest square grid of at most this many rays.
  [[nodiscard]] static unsigned side_of(std::size_t rays) noexcept;

  /// Lets the rays of a receiver meet these discs, as one of several parts of a scene. The nearest
  /// disc of all parts does not depend on how the discs are divided, as long as all parts have the
  /// same Space. After the last part, sum() gives the result that trace() has for the whole scene.
  /// @param hits  one for each ray, a square number; replaced where a disc of this part is nearer
  void meet(const Receiver& receiver, std::uint64_t seed, std::span<DiscHit> hits) const;
  /// Sums up what the rays of a receiver have met.
  /// @param seed  that of meet()
  /// @param hits  as meet() has left them
  /// @param sky   radiance that arrives from a direction (unit); empty where there is no sky
  [[nodiscard]] static Shading sum(const Receiver& receiver, std::uint64_t seed,
                                   std::span<const DiscHit> hits,
                                   const std::function<glm::vec3(const glm::vec3&)>& sky);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
