// Traces rays at the discs of a container of any size, under a memory cap.
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

/// DiscRays under a cap. It holds as many surfels at a time as the cap has room for, and lets every
/// ray meet one part of the scene after the other:
///
///     for each batch of receivers
///       for each part of the point pages: load it, let all rays of the batch meet it
///       sum up the rays
///
/// Results do not depend on the cap.
class StreamedRays {
 public:
  /// Minimum cap, bytes.
  static constexpr std::uint64_t kMinBytes = std::uint64_t{16} << 20;

  /// Loads the first part.
  /// @param scene         must outlive this
  /// @param sides         which sides of surfels stop rays
  /// @param sky           radiance that arrives from a direction (unit); empty without a sky
  /// @param memory_bytes  cap, at least kMinBytes
  StreamedRays(const ContainerReader& scene, Sides sides,
               std::function<glm::vec3(const glm::vec3&)> sky, std::uint64_t memory_bytes);

  /// Traces receivers as DiscRays::trace() does. Receiver i takes `seed` + i.
  /// @param rays      number of rays for each receiver, rounded down to a square number
  /// @param results   as many as receivers, in their order
  /// @param progress  advances by one for each receiver
  /// @throws FormatError when a page is damaged
  void trace(std::span<const Receiver> receivers, unsigned rays, std::uint64_t seed,
             std::span<Shading> results, const Executor& executor, Progress& progress);

 private:
  /// Loads a part, unless it is the one that is loaded.
  void load(std::size_t part);

  const ContainerReader& scene_;
  Sides sides_;
  std::function<glm::vec3(const glm::vec3&)> sky_;
  std::size_t hit_count_;         ///< maximum number of rays in a batch
  std::size_t pages_of_part_;     ///< point pages in each part but the last
  std::size_t parts_;             ///< number of parts
  std::vector<Surfel> surfels_;   ///< of the loaded part
  std::optional<DiscRays> rays_;  ///< at those surfels
  std::size_t loaded_ = 0;        ///< number of the loaded part, while rays_ has a value
};

}  // namespace ptc
