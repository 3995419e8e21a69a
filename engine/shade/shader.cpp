#include "engine/shade/shader.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "engine/shade/gather/receiver_cell.h"

namespace ptc {

struct Shader::Impl {
  const Executor& executor;
  SceneView view;
  std::vector<std::unique_ptr<DirectionGrid>> grids;  // one a variant
  GatherOptions gather_options;
  std::unique_ptr<PageCache> own_cache;
  PageCache& cache;
  std::vector<std::unique_ptr<Gather>> gathers;  // one per thread, made when first needed
  GatherCounts counts;

  Impl(const ContainerReader& container, const ShadeOptions& options, const Executor& e)
      : executor(e),
        view(container, options.lost),
        gather_options(options.gather),
        own_cache(options.cache ? nullptr : make_cache(container, options, e)),
        cache(options.cache ? *options.cache : *own_cache),
        gathers(e.threads()) {
    for (unsigned i = 0; i < std::max(1U, options.variants); ++i) {
      grids.push_back(std::make_unique<DirectionGrid>(options.gather.resolution, options.sky, i));
    }
  }

  static std::unique_ptr<PageCache> make_cache(const ContainerReader& container,
                                               const ShadeOptions& options, const Executor& e) {
    return std::make_unique<PageCache>(container, CacheOptions{.memory_bytes = options.cache_bytes,
                                                               .threads = e.threads(),
                                                               .back_end = options.back_end});
  }

  Gather& gather(unsigned thread) {
    if (!gathers[thread]) gathers[thread] = std::make_unique<Gather>(view, cache, gather_options);
    return *gathers[thread];
  }

  /// Indices of the receivers along the Z-curve.
  [[nodiscard]] std::vector<std::size_t> z_order(std::span<const Receiver> receivers,
                                                 unsigned variant) const {
    struct Placed {
      MortonKey key;
      std::size_t index;
    };
    std::vector<Placed> placed(receivers.size());
    executor.for_ranges(receivers.size(), 1 << 14, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        placed[i] = {receiver_key(view.frame(), receivers[i].position, variant), i};
      }
    });
    std::ranges::sort(placed, [](const Placed& a, const Placed& b) {
      return a.key != b.key ? a.key < b.key : a.index < b.index;
    });
    std::vector<std::size_t> order(placed.size());
    std::ranges::transform(placed, order.begin(), [](const Placed& p) { return p.index; });
    return order;
  }
};

Shader::Shader(const ContainerReader& container, const ShadeOptions& options,
               const Executor& executor)
    : impl_(std::make_unique<Impl>(container, options, executor)) {}
Shader::~Shader() = default;

void Shader::shade(std::span<const Receiver> receivers, std::span<Shading> results,
                   Progress& progress, unsigned variant) {
  variant %= static_cast<unsigned>(impl_->grids.size());
  const std::vector<std::size_t> order = impl_->z_order(receivers, variant);
  const std::size_t blocks = (order.size() + kBlock - 1) / kBlock;
  impl_->executor.for_each(blocks, [&](std::size_t block, unsigned thread) {
    const auto indices =
        std::span(order).subspan(block * kBlock, std::min(kBlock, order.size() - block * kBlock));
    std::vector<Receiver> in(indices.size());
    std::vector<Shading> out(indices.size());
    std::ranges::transform(indices, in.begin(), [&](std::size_t i) { return receivers[i]; });
    impl_->gather(thread).shade(in, out, *impl_->grids[variant]);
    for (std::size_t i = 0; i < indices.size(); ++i) results[indices[i]] = out[i];
    progress.advance(indices.size());
  });
}

GatherCounts Shader::counts() const {
  GatherCounts sum = impl_->counts;
  for (const auto& gather : impl_->gathers) {
    if (gather) sum.add(gather->counts());
  }
  return sum;
}

CacheStatistics Shader::cache_statistics() const {
  // Readers report when they end; their counts go on in Impl::counts.
  for (auto& gather : impl_->gathers) {
    if (gather) impl_->counts.add(gather->counts());
    gather.reset();
  }
  return impl_->cache.statistics();
}

}  // namespace ptc
