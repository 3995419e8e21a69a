// Divides the cap: a quarter of it, at most 64 MiB, for the hits of a batch of rays, and the rest
// for one part of the surfels with its tree.
#include "engine/shade/reference/streamed_rays.h"

#include <algorithm>
#include <cmath>

#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::uint64_t kSurfelBytes = sizeof(Surfel) + DiscRays::kBytes;  // decoded, and its tree

}  // namespace

StreamedRays::StreamedRays(const ContainerReader& scene, Sides sides,
                           std::function<glm::vec3(const glm::vec3&)> sky,
                           std::uint64_t memory_bytes)
    : scene_(scene), sides_(sides), sky_(std::move(sky)) {
  const std::uint64_t for_hits = std::min<std::uint64_t>(memory_bytes / 4, std::uint64_t{64} << 20);
  hit_count_ = static_cast<std::size_t>(for_hits / sizeof(DiscHit));
  const std::uint64_t page_bytes = kSurfelBytes * points_per_page(scene.header());
  pages_of_part_ =
      static_cast<std::size_t>(std::max<std::uint64_t>(1, (memory_bytes - for_hits) / page_bytes));
  parts_ = (scene.point_pages().size() + pages_of_part_ - 1) / pages_of_part_;
  if (parts_ > 0) load(0);
}

void StreamedRays::load(std::size_t part) {
  // Read the pages of the part, after the tree of the last one is gone.
  if (rays_ && loaded_ == part) return;
  rays_.reset();
  const PageNumbers::Range pages = scene_.point_pages().subrange(
      part * pages_of_part_,
      std::min(pages_of_part_, scene_.point_pages().size() - part * pages_of_part_));
  surfels_.clear();
  surfels_.reserve(pages.size() * points_per_page(scene_.header()));
  append_surfels(scene_, pages, surfels_);
  // Build its tree in the frame of the whole scene, the same for every part.
  const Superblock& whole = scene_.superblock();
  const glm::dvec3 low(whole.bounds_low[0], whole.bounds_low[1], whole.bounds_low[2]);
  const glm::dvec3 high(whole.bounds_high[0], whole.bounds_high[1], whole.bounds_high[2]);
  rays_.emplace(surfels_, sides_, sky_,
                DiscRays::Space{(low + high) * 0.5, SceneScale(scene_.header().frame)});
  loaded_ = part;
}

void StreamedRays::trace(std::span<const Receiver> receivers, unsigned rays, std::uint64_t seed,
                         std::span<Shading> results, const Executor& executor, Progress& progress) {
  // Find how many receivers have room for their rays at once.
  const std::size_t side = DiscRays::side_of(rays);
  const std::size_t rays_of_each = side * side;
  const std::size_t batch = std::clamp<std::size_t>(hit_count_ / rays_of_each, 1,
                                                    std::max<std::size_t>(1, receivers.size()));
  std::vector<DiscHit> hits(batch * rays_of_each);
  const auto hits_of = [&](std::size_t i) {
    return std::span(hits).subspan(i * rays_of_each, rays_of_each);
  };
  // Let the rays of a batch meet every part, and sum them up.
  for (std::size_t first = 0; first < receivers.size(); first += batch) {
    const std::size_t count = std::min(batch, receivers.size() - first);
    std::ranges::fill(hits, DiscHit{});
    for (std::size_t part = 0; part < parts_; ++part) {
      load(part);
      executor.for_each(count, [&](std::size_t i, unsigned) {
        rays_->meet(receivers[first + i], seed + first + i, hits_of(i));
        if (part + 1 == parts_) progress.advance(1);
      });
    }
    executor.for_each(count, [&](std::size_t i, unsigned) {
      results[first + i] = DiscRays::sum(receivers[first + i], seed + first + i, hits_of(i), sky_);
    });
  }
}

}  // namespace ptc
