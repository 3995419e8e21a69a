// Rays at the discs of a container of any size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/shade/reference/brute_force.h"

namespace ptc {

/// DiscRays under a cap: holds as many surfels at a time as the cap has room for, and lets every
/// ray meet one part after the other. Results do not depend on the cap.
class StreamedRays {
 public:
  static constexpr std::uint64_t kMinBytes = std::uint64_t{16} << 20;

  /// Loads the first part.
  /// @param sky           as DiscRays
  /// @param memory_bytes  cap, kMinBytes at least
  StreamedRays(const ContainerReader& scene, Sides sides,
               std::function<glm::vec3(const glm::vec3&)> sky, std::uint64_t memory_bytes);

  /// Traces receivers with seeds that follow `seed`, as DiscRays::trace().
  /// @param progress  advances by one a receiver
  void trace(std::span<const Receiver> receivers, unsigned rays, std::uint64_t seed,
             std::span<Shading> results, const Executor& executor, Progress& progress);

 private:
  void load(std::size_t part);

  const ContainerReader& scene_;
  Sides sides_;
  std::function<glm::vec3(const glm::vec3&)> sky_;
  std::size_t hit_count_;  // rays that may be under way at once
  std::size_t pages_of_part_;
  std::size_t parts_;
  std::vector<Surfel> surfels_;  // of the part that is loaded
  std::optional<DiscRays> rays_;
  std::size_t loaded_ = 0;  // valid while rays_ is
};

}  // namespace ptc
