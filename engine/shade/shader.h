// Shading many receivers on many threads under one cap.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/cache/page_cache.h"
#include "engine/shade/gather/gather.h"

namespace ptc {

struct ShadeOptions {
  std::uint64_t cache_bytes = std::uint64_t{512} << 20;  ///< page cache, all threads together
  BackEnd back_end = BackEnd::pread;
  GatherOptions gather;
  /// Radiance that arrives from a direction (unit) where nothing covers it; empty: none.
  std::function<glm::vec3(const glm::vec3&)> sky;
  /// Pages to read through in place of a cache of its own, for as many threads; it outlives the
  /// Shader.
  PageCache* cache = nullptr;
  LostPages* lost = nullptr;  ///< goes on past damaged pages, which it tells there; null: they are
                              ///< errors. It outlives the Shader
  unsigned variants =
      1;  ///< turns of the direction cube and shifts of the receiver cells to choose from
};

/// Keeps cache and gathers between calls.
class Shader {
 public:
  Shader(const ContainerReader& container, const ShadeOptions& options, const Executor& executor);
  ~Shader();

  /// Receivers of a block: neighbours on the Z-curve that one thread shades together.
  static constexpr std::size_t kBlock = 4096;

  /// Sorts the receivers along the Z-curve, shades them block by block. A receiver's result depends
  /// on the receivers of its block, so callers that stream give multiples of kBlock, in Z order.
  /// @param results  as many as receivers, in their order
  /// @param variant  modulo the variants there are. The errors of two variants are not alike: their
  ///                 mean has fewer
  void shade(std::span<const Receiver> receivers, std::span<Shading> results, Progress& progress,
             unsigned variant = 0);

  [[nodiscard]] GatherCounts counts() const;
  /// Complete once no shade() is running; gives back the readers that the cache allows.
  [[nodiscard]] CacheStatistics cache_statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
