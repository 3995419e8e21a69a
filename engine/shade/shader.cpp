#include "engine/shade/shader.h"

#include <algorithm>

#include "engine/shade/gather/receiver_cell.h"

namespace ptc {
namespace {

std::unique_ptr<PageCache> make_cache(const ContainerReader& container, const ShadeOptions& options,
                                      const Executor& executor) {
  return std::make_unique<PageCache>(container,
                                     CacheOptions{.memory_bytes = options.cache_bytes,
                                                  .threads = executor.threads() * options.readers(),
                                                  .back_end = options.back_end});
}

}  // namespace

std::vector<std::size_t> order_along_curve(const Frame& frame, std::span<const Receiver> receivers,
                                           unsigned variant, const Executor& executor) {
  struct Placed {
    MortonKey key;
    std::size_t index;
  };
  std::vector<Placed> placed(receivers.size());
  executor.for_ranges(receivers.size(), 1 << 14, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      placed[i] = {receiver_key(frame, receivers[i].position, variant), i};
    }
  });
  std::ranges::sort(placed, [](const Placed& a, const Placed& b) {
    return a.key != b.key ? a.key < b.key : a.index < b.index;
  });
  std::vector<std::size_t> order(placed.size());
  std::ranges::transform(placed, order.begin(), [](const Placed& p) { return p.index; });
  return order;
}

Shader::Shader(const ContainerReader& container, const ShadeOptions& options,
               const Executor& executor)
    : executor_(executor),
      view_(container, options.lost),
      options_(options.gather),
      things_left_(options.things_left),
      visibility_(options.visibility_of_sky()),
      own_cache_(options.cache ? nullptr : make_cache(container, options, executor)),
      cache_(options.cache ? *options.cache : *own_cache_),
      gathers_(executor.threads()) {
  for (unsigned i = 0; i < std::max(1U, options.variants); ++i) {
    grids_.push_back(std::make_unique<DirectionGrid>(options.gather.resolution, options.sky, i));
  }
}

Gather& Shader::gather(unsigned thread) {
  if (!gathers_[thread])
    gathers_[thread] = std::make_unique<Gather>(view_, cache_, options_, visibility_, things_left_);
  return *gathers_[thread];
}

void Shader::shade(std::span<const Receiver> receivers, std::span<Shading> results,
                   Progress& progress, unsigned variant) {
  std::vector<std::size_t> counts(variant % grids_.size() + 1);
  counts.back() = receivers.size();
  shade_variants(receivers, results, progress, counts);
}

void Shader::shade_variants(std::span<const Receiver> receivers, std::span<Shading> results,
                            Progress& progress, std::span<const std::size_t> counts) {
  // Cut the receivers of each variant into blocks along the Z-curve
  struct Run {
    std::size_t variant, number;
    std::size_t first;  ///< in its variant's order
  };
  std::vector<Run> blocks;
  std::vector<std::size_t> begins(1, 0);
  std::vector<std::vector<std::size_t>> orders;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    orders.push_back(order_along_curve(view_.frame(), receivers.subspan(begins[i], counts[i]),
                                       static_cast<unsigned>(i % grids_.size()), executor_));
    begins.push_back(begins[i] + counts[i]);
    for (std::size_t first = 0; first < counts[i]; first += kBlock)
      blocks.push_back({i, first / kBlock, first});
  }
  // Shade them, block by block of all variants
  std::ranges::stable_sort(blocks, {}, &Run::number);
  executor_.for_each(blocks.size(), [&](std::size_t index, unsigned thread) {
    const Run& block = blocks[index];
    const std::span<const std::size_t> order(orders[block.variant]);
    const auto indices = order.subspan(block.first, std::min(kBlock, order.size() - block.first));
    const std::size_t begin = begins[block.variant];
    std::vector<Receiver> in(indices.size());
    std::vector<Shading> out(indices.size());
    std::ranges::transform(indices, in.begin(),
                           [&](std::size_t i) { return receivers[begin + i]; });
    gather(thread).shade(in, out, *grids_[block.variant % grids_.size()]);
    for (std::size_t i = 0; i < indices.size(); ++i) results[begin + indices[i]] = out[i];
    progress.advance(indices.size());
  });
}

GatherCounts Shader::counts() const {
  GatherCounts sum = counts_;
  for (const auto& gather : gathers_) {
    if (gather) sum.add(gather->counts());
  }
  return sum;
}

CacheStatistics Shader::cache_statistics() {
  for (auto& gather : gathers_) {
    if (gather) counts_.add(gather->counts());
    gather.reset();
  }
  return cache_.statistics();
}

}  // namespace ptc
