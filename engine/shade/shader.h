// Shading many receivers on many threads under one cap.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/cache/page_cache.h"
#include "engine/shade/gather/gather.h"

namespace ptc {

/// What a shader may use, and how closely it gathers.
struct ShadeOptions {
  std::uint64_t cache_bytes = std::uint64_t{512} << 20;  ///< page cache of all threads together
  BackEnd back_end = BackEnd::pread;
  GatherOptions gather;
  /// The radiance that arrives from a direction (unit vector) where nothing covers it, W / (m^2
  /// sr); empty: none.
  std::function<glm::vec3(const glm::vec3&)> sky;
  /// A cache that the shader reads through, made for readers() of each thread; it must outlive the
  /// shader. With null the shader makes its own.
  PageCache* cache = nullptr;
  /// Makes the rays through small openings of each gather, where there is a sky; empty: the sky is
  /// as it is drawn.
  VisibilityMaker visibility;
  /// The place where damaged pages are noted, which shading then passes over; it must outlive the
  /// shader. With null, damaged pages are errors.
  LostPages* lost = nullptr;
  /// How many variants there are to choose from. Each turns the direction cube and shifts the
  /// receiver cells in another way.
  unsigned variants = 1;
  std::size_t things_left = Gather::kThingsLeft;  ///< of each gather: fewer in a test

  /// Returns what a gather needs to find the sky through small openings; empty without a sky.
  [[nodiscard]] VisibilityMaker visibility_of_sky() const {
    return sky ? visibility : VisibilityMaker();
  }
  /// Returns how many readers of the cache a thread of a shader needs.
  [[nodiscard]] unsigned readers() const { return visibility_of_sky() ? 2 : 1; }
};

/// Returns the indices of receivers along the Z-curve of a variant: the order in which a Shader
/// cuts them into blocks.
[[nodiscard]] std::vector<std::size_t> order_along_curve(const Frame& frame,
                                                         std::span<const Receiver> receivers,
                                                         unsigned variant,
                                                         const Executor& executor);

/// Shades receivers block by block, and keeps the page cache and the gathers between calls.
class Shader {
 public:
  /// @param container  must outlive the shader, as must the executor
  Shader(const ContainerReader& container, const ShadeOptions& options, const Executor& executor);

  /// The receivers of a block: neighbours on the Z-curve that one thread shades together.
  static constexpr std::size_t kBlock = 4096;

  /// Sorts the receivers along the Z-curve and shades them block by block. The result of a receiver
  /// depends on the receivers of its block, so callers that stream should pass multiples of kBlock,
  /// in Z order.
  /// @param results  as many as receivers, in the same order
  /// @param variant  taken modulo ShadeOptions::variants. Two variants have different errors, so
  ///                 their mean has a smaller one
  /// @throws FormatError for a damaged page, unless ShadeOptions::lost is set; std::system_error
  void shade(std::span<const Receiver> receivers, std::span<Shading> results, Progress& progress,
             unsigned variant = 0);
  /// Shades receivers with several variants as shade() does those of each, but in an order in which
  /// all variants shade what is close together one after another, so that they find the same pages.
  /// @param counts  by variant: how many of the receivers it shades, those of variant 0 first
  void shade_variants(std::span<const Receiver> receivers, std::span<Shading> results,
                      Progress& progress, std::span<const std::size_t> counts);

  /// The counts of all calls so far.
  [[nodiscard]] GatherCounts counts() const;
  /// The statistics of the page cache. Not while shade() runs: the gathers are released, so that
  /// their readers' counts are complete, and are made again by the next shade().
  [[nodiscard]] CacheStatistics cache_statistics();

 private:
  [[nodiscard]] Gather& gather(unsigned thread);

  const Executor& executor_;
  SceneView view_;
  std::vector<std::unique_ptr<DirectionGrid>> grids_;  ///< by variant
  GatherOptions options_;
  std::size_t things_left_;
  VisibilityMaker visibility_;
  std::unique_ptr<PageCache> own_cache_;
  PageCache& cache_;
  std::vector<std::unique_ptr<Gather>> gathers_;  ///< by thread, made when first needed
  GatherCounts counts_;                           ///< of gathers that were released
};

}  // namespace ptc
