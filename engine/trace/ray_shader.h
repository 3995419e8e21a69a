// Shades receivers by exact rays at the discs of a container of any size, under a memory cap.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/cache/page_cache.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shader.h"
#include "engine/trace/disc_tracer.h"

namespace ptc {

/// What rays are to find, and what they may use.
struct RayOptions {
  Sides sides = Sides::both;  ///< sides of surfels that stop rays
  /// Radiance that arrives from a direction (unit) where nothing covers it, W / (m^2 sr); empty:
  /// none.
  std::function<glm::vec3(const glm::vec3&)> sky;
  bool bleeding = true;  ///< false leaves out the light from surfaces, which takes less time
  bool emission = true;  ///< as GatherOptions::emission
  /// Cap of the page cache and of what threads decode. Raised to PageCache::min_bytes() plus
  /// DiscTracer::kBytes for each thread where it is less.
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;
  BackEnd back_end = BackEnd::pread;
};

/// Rough mirrors that an eye looks at.
struct Mirrors {
  glm::dvec3 eye{0};    ///< scene units
  float roughness = 0;  ///< 0 to 1, as for lobe_directions()
  unsigned rays = 64;   ///< of each receiver
};

/// Returns the options of rays that find what a shader approximates, under the same cap.
[[nodiscard]] RayOptions ray_options(const ShadeOptions& options);

/// Shades receivers by rays through the octree: far-apart ones cheaper than the gather, and others
/// as the reference for its own error.
///
/// Results depend on the receivers, the number of rays and the seed alone.
/// Memory: RayOptions::memory_bytes, and kRayBytes for each ray of a receiver and thread.
class RayShader {
 public:
  static constexpr std::uint64_t kRayBytes = 64;
  /// Returns the least that RayOptions::memory_bytes are raised to.
  [[nodiscard]] static std::uint64_t least_bytes(const ContainerReader& scene, unsigned threads,
                                                 BackEnd back_end);

  /// @param scene, executor  must outlive this
  RayShader(const ContainerReader& scene, const RayOptions& options, const Executor& executor);
  ~RayShader();

  /// Traces cosine-distributed rays from receivers, those of cosine_directions(). Receiver i takes
  /// `seed` + i.
  /// @param rays      number of rays for each receiver
  /// @param results   as many as receivers, in their order
  /// @param progress  advances by one for each receiver
  /// @throws FormatError when a page is damaged; std::system_error
  void trace(std::span<const Receiver> receivers, unsigned rays, std::uint64_t seed,
             std::span<Shading> results, Progress& progress);

  /// Traces rays in the lobes of receivers that are rough mirrors. What surfaces emit counts, too.
  /// Receiver i takes `seed` + i.
  /// @param results  as many as receivers, in their order
  /// @throws FormatError when a page is damaged; std::system_error
  void reflect(std::span<const Receiver> receivers, const Mirrors& mirrors, std::uint64_t seed,
               std::span<Reflection> results);

  /// Frees what threads have decoded, and returns what the page cache counted.
  [[nodiscard]] CacheStatistics cache_statistics();

 private:
  struct Worker;

  [[nodiscard]] Worker& worker(unsigned thread);
  /// Calls body(index, worker) for all receivers along the Z-curve, on all threads.
  template <class Body>
  void for_each_along(std::span<const Receiver> receivers, const Body& body);
  /// Finds what rays along `directions` meet, into Worker::seen.
  /// @param emission  whether what surfaces emit counts
  void look(Worker& own, const Receiver& receiver, std::span<const glm::vec3> directions,
            bool emission) const;

  const Executor& executor_;
  SceneView view_;
  RayOptions options_;
  std::unique_ptr<PageCache> cache_;
  std::vector<std::unique_ptr<Worker>> workers_;  ///< by thread, made when first needed
};

}  // namespace ptc
