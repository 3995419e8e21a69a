// Oracles: every surfel counts, no cluster stands for it.
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

/// All surfels of a container, decoded. @throws RequestError above `limit` points, so that a
/// reference run on a city does not exhaust memory.
[[nodiscard]] std::vector<Surfel> load_surfels(const ContainerReader& container,
                                               std::uint64_t limit);

/// Surfels of some of its point pages, behind those that are there.
void append_surfels(const ContainerReader& container, std::span<const std::uint32_t> pages,
                    std::vector<Surfel>& surfels);

/// The gather without hierarchy: every surfel is drawn as an exact disc for every receiver. What is
/// left against rays is the error of direction pixels.   Time: receivers x surfels.
void shade_brute_force(std::span<const Surfel> surfels, std::span<const Receiver> receivers,
                       std::span<Shading> results, const DirectionGrid& grid, Sides sides,
                       const Executor& executor);

/// What a ray has met so far.
struct DiscHit {
  /// Bumped (spec/shading.md#surfels), in edges of the frame.
  float depth = std::numeric_limits<float>::infinity();
  glm::vec3 radiance{0};  ///< of the side that it met

  [[nodiscard]] bool met() const noexcept { return depth < std::numeric_limits<float>::infinity(); }
};

/// Embree rays at the same discs: the reference for the gather's own error.
///
/// The discs divide where they overlap as in DirectionBuffer::draw(), and their back sides
/// follow the same rule. Threads: calls may be made concurrently. Memory: kBytes a surfel.
class DiscRays {
 public:
  static constexpr std::uint64_t kBytes =
      200;  ///< of a surfel, at the most, while its tree is built

  /// Where rays are exact, and the unit of what Embree is given, whose numbers end at 1.8e18.
  struct Space {
    glm::dvec3 origin{0};
    SceneScale scale{Frame{}};
  };
  /// @param space  the middle of the surfels and the edge of a frame around them when empty
  DiscRays(std::span<const Surfel> surfels, Sides sides,
           std::function<glm::vec3(const glm::vec3&)> sky, const std::optional<Space>& space = {});
  ~DiscRays();

  /// @param rays  stratified cosine rays, rounded down to a square   Deterministic in `seed`.
  [[nodiscard]] Shading trace(const Receiver& receiver, unsigned rays, std::uint64_t seed) const;

  /// The same in parts, where the discs of several make one scene: what is nearest of all of them
  /// does not depend on how they are divided, if their origin is the same.
  /// @param hits  of as many rays, a square number; where a disc of this is nearer it takes its
  /// place
  void meet(const Receiver& receiver, std::uint64_t seed, std::span<DiscHit> hits) const;
  [[nodiscard]] static Shading sum(const Receiver& receiver, std::uint64_t seed,
                                   std::span<const DiscHit> hits,
                                   const std::function<glm::vec3(const glm::vec3&)>& sky);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
