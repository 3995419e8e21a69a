// Primary visibility without a mesh: rays through the octree at the discs of a container
// (engine/trace/camera_tracer.h), one for each sample.
//
// The samples are taken block by block, and each block tile by tile, so that what a thread has
// decoded for one tile serves the next. Within a tile they lie on a Z-curve, so that any 8 that
// follow one another are neighbours:
//
//     +-----+-----+          tile 16 x 16     0 1  4 5
//     |block|     |   ->    +--+--+--+   ->   2 3  6 7     -> hits, by the order of their points:
//     +-----+-----+         +--+--+--+        8 9 ...         a page is pinned once for all of them
#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/io/cloud/record.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/render/splat_view.h"
#include "engine/store/attribute_rows.h"
#include "engine/trace/camera_tracer.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr unsigned kTileBits = 4;                // of the side of a tile
constexpr unsigned kTileSide = 1U << kTileBits;  // samples
constexpr unsigned kBlockTiles = 4;              // along the side of a block
constexpr unsigned kBlockSide = kBlockTiles * kTileSide;

/// Returns the even bits of a number, side by side.
unsigned even_bits(unsigned number) {
  unsigned found = 0;
  for (unsigned bit = 0; bit < kTileBits; ++bit) found |= (number >> 2 * bit & 1) << bit;
  return found;
}

/// A view of the surfels of a container.
class CloudView : public SplatView {
 public:
  CloudView(const ContainerReader& scene, const Camera& camera, const SurfelViewOptions& options)
      : SplatView(scene, camera, options.side, options.lift),
        scene_(scene),
        view_(scene, options.lost),
        rise_groups_(rise_groups(scene.meta().channels)) {}

  /// Traces the rays of all samples.
  void trace(const SurfelViewOptions& options, const Executor& executor, Progress& progress) {
    PageCache cache(scene_, cache_options(options, executor.threads()));
    std::vector<std::unique_ptr<Worker>> workers(executor.threads());
    const unsigned columns = (width_ + kBlockSide - 1) / kBlockSide,
                   rows = (height_ + kBlockSide - 1) / kBlockSide;
    executor.for_each(std::size_t{columns} * rows, [&](std::size_t block, unsigned thread) {
      if (!workers[thread]) workers[thread] = std::make_unique<Worker>(*this, cache);
      const unsigned x0 = static_cast<unsigned>(block % columns) * kBlockSide,
                     y0 = static_cast<unsigned>(block / columns) * kBlockSide;
      for (unsigned y = y0; y < std::min(height_, y0 + kBlockSide); y += kTileSide) {
        for (unsigned x = x0; x < std::min(width_, x0 + kBlockSide); x += kTileSide)
          progress.advance(trace_tile(x, y, *workers[thread]));
      }
    });
    workers.clear();
    finish(executor);
  }

 private:
  /// What a thread needs.
  struct Worker {
    CameraTracer tracer;
    AttributeRows attributes;
    RisePlace rise;
    std::vector<std::size_t> samples;  ///< indices of the tile's samples
    std::vector<glm::vec3> directions;
    std::vector<RayHit> hits;
    std::vector<std::uint32_t> order;  ///< of the hits, by their points

    Worker(const CloudView& cloud, PageCache& cache)
        : tracer(cloud.view_, cache, cloud.position_, cloud.axes_),
          attributes(cloud.scene_, cloud.rise_groups_),
          rise(attributes.channels()) {}
  };

  [[nodiscard]] CacheOptions cache_options(const SurfelViewOptions& options,
                                           unsigned threads) const {
    const std::uint64_t tracers = threads * CameraTracer::kBytes;
    const std::uint64_t left = options.memory_bytes - std::min(options.memory_bytes, tracers);
    return {.memory_bytes = std::max(left, PageCache::min_bytes(scene_, threads, options.back_end)),
            .threads = threads,
            .back_end = options.back_end};
  }

  /// Traces the rays of a tile. @return the number of its samples
  std::size_t trace_tile(unsigned x0, unsigned y0, Worker& own) {
    own.samples.clear();
    own.directions.clear();
    for (unsigned i = 0; i < kTileSide * kTileSide; ++i) {
      const unsigned x = x0 + even_bits(i), y = y0 + even_bits(i >> 1);
      if (x >= width_ || y >= height_) continue;
      own.samples.push_back(std::size_t{y} * width_ + x);
      own.directions.push_back(axes_ * ray(x, y));
    }
    own.hits.assign(own.samples.size(), RayHit{});
    own.tracer.meet(own.directions, own.hits);
    keep(own);
    return own.samples.size();
  }

  /// Writes what the rays of a tile have met to their samples.
  void keep(Worker& own) {
    own.order.clear();
    for (std::uint32_t i = 0; i < own.hits.size(); ++i) {
      if (own.hits[i].met()) own.order.push_back(i);
    }
    std::ranges::sort(own.order, {}, [&](std::uint32_t i) { return own.hits[i].point; });
    for (std::size_t from = 0; from < own.order.size();) {
      // Take the hits on one page
      const std::uint64_t rank = own.hits[own.order[from]].point / view_.points_per_page();
      const PageGuard page = own.tracer.page_of(own.hits[own.order[from]]);
      const PointPage points(page.payload(), page.record_count(), view_.point_bytes());
      const std::byte* const rows = own.attributes.read(rank, page.record_count()).data();
      for (; from < own.order.size(); ++from) {
        const RayHit& hit = own.hits[own.order[from]];
        if (hit.point / view_.points_per_page() != rank) break;
        const auto at = static_cast<std::uint32_t>(hit.point % view_.points_per_page());
        SplatSample& sample = samples_[own.samples[own.order[from]]];
        sample.depth = hit.depth;
        sample.payload = payload_of(to_surfel(points[at], frame_),
                                    own.rise.radii(rows + at * own.attributes.row_bytes()));
        sample.payload.back = hit.back;
      }
    }
  }

  const ContainerReader& scene_;
  SceneView view_;
  std::vector<std::uint8_t> rise_groups_;
};

}  // namespace

std::unique_ptr<PrimaryView> view_surfels(const ContainerReader& scene, const Camera& camera,
                                          const SurfelViewOptions& options,
                                          const Executor& executor, Progress& progress) {
  auto view = std::make_unique<CloudView>(scene, camera, options);
  view->trace(options, executor, progress);
  return view;
}

}  // namespace ptc
