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
#include "format/scalar.h"

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

/// A view of the surfels of a container: of the whole picture or, where the depth buffer would take
/// too much, of the rectangle that is looked at, with a margin from which its holes are closed.
///
///     +- - - - - - - - - -+
///       kHoleReach        '
///     ' +-------------+   '
///       |  seen_      |       seen_ grows to the right as far as the depth buffer allows
///     ' |             |   '
///       +-------------+       area_ is traced; a picture's full width grows downwards
///     +- - - - - - - - - -+
class CloudView : public SplatView {
 public:
  CloudView(const ContainerReader& scene, const Camera& camera, const SurfelViewOptions& options,
            const Executor& executor)
      : SplatView(scene, camera, options.side, options.lift),
        scene_(scene),
        options_(options),
        executor_(executor),
        view_(scene, options.lost),
        rise_groups_(rise_groups(scene.meta().channels)) {}

  /// Says whether the depth buffer may hold the whole picture.
  [[nodiscard]] bool holds_all() const {
    return whole().samples() * kSplatBytes <= options_.depth_bytes;
  }

  /// Looks at the whole picture. Nothing has to be looked at afterwards.
  void look_at_all(Progress& progress) {
    trace(whole(), progress);
    finish(executor_);
    free_pages();
    seen_ = whole();
  }

  void look_at(const SampleRect& rect, bool on) override {
    if (seen_.contains(rect)) return;
    Progress silent;
    seen_ = on ? widened(rect) : rect;
    trace(around(seen_), silent);
    finish(executor_);
  }

  /// Returns what sparse_share() describes for a view that is this many times finer.
  [[nodiscard]] double sparse_share(float finer) {
    constexpr float kSparse = 1;  // radii
    Progress silent;
    trace(whole(), silent);
    std::size_t seen = 0, sparse = 0;
    for (const SplatSample& sample : samples_) {
      if (sample.empty()) continue;
      ++seen;
      const float radius = scale_.radius(decode_ufloat16(sample.payload.radius));
      if (sample.depth > kSparse * radius * focal_ * finer) ++sparse;
    }
    return seen == 0 ? 0 : static_cast<double>(sparse) / static_cast<double>(seen);
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

  /// Adds the margin that its holes need to a rectangle.
  [[nodiscard]] SampleRect around(const SampleRect& rect) const {
    const auto before = [](unsigned at) { return at - std::min(at, kHoleReach); };
    return {before(rect.x0), before(rect.y0), std::min(width_, rect.x1 + kHoleReach),
            std::min(height_, rect.y1 + kHoleReach)};
  }

  /// Lets a rectangle grow to the right as far as the depth buffer allows and, if it is as wide as
  /// the picture then, downwards.
  [[nodiscard]] SampleRect widened(SampleRect rect) const {
    const SampleRect traced = around(rect);
    const std::uint64_t columns = options_.depth_bytes / kSplatBytes / (traced.y1 - traced.y0);
    if (columns > traced.x1 - traced.x0) {
      const std::uint64_t right = traced.x0 + columns;
      rect.x1 =
          right >= width_ ? width_ : std::max(rect.x1, static_cast<unsigned>(right) - kHoleReach);
    }
    if (rect.x0 > 0 || rect.x1 < width_) return rect;
    const std::uint64_t rows = options_.depth_bytes / kSplatBytes / width_;
    const std::uint64_t below = traced.y0 + rows;
    rect.y1 = below >= height_
                  ? height_
                  : std::max(rect.y1, static_cast<unsigned>(below) -
                                          std::min(static_cast<unsigned>(below), kHoleReach));
    return rect;
  }

  /// Traces the rays of a part of the picture.
  void trace(const SampleRect& area, Progress& progress) {
    begin(area);
    if (!cache_) {
      cache_ = std::make_unique<PageCache>(scene_, cache_options());
      workers_.resize(executor_.threads());
    }
    const unsigned columns = (area.x1 - area.x0 + kBlockSide - 1) / kBlockSide,
                   rows = (area.y1 - area.y0 + kBlockSide - 1) / kBlockSide;
    executor_.for_each(std::size_t{columns} * rows, [&](std::size_t block, unsigned thread) {
      if (!workers_[thread]) workers_[thread] = std::make_unique<Worker>(*this, *cache_);
      const unsigned x0 = area.x0 + static_cast<unsigned>(block % columns) * kBlockSide,
                     y0 = area.y0 + static_cast<unsigned>(block / columns) * kBlockSide;
      for (unsigned y = y0; y < std::min(area.y1, y0 + kBlockSide); y += kTileSide) {
        for (unsigned x = x0; x < std::min(area.x1, x0 + kBlockSide); x += kTileSide)
          progress.advance(trace_tile(x, y, *workers_[thread]));
      }
    });
  }

  void free_pages() {
    workers_.clear();
    cache_.reset();
  }

  [[nodiscard]] CacheOptions cache_options() const {
    const unsigned threads = executor_.threads();
    const std::uint64_t tracers = threads * CameraTracer::kBytes;
    const std::uint64_t left = options_.memory_bytes - std::min(options_.memory_bytes, tracers);
    return {
        .memory_bytes = std::max(left, PageCache::min_bytes(scene_, threads, options_.back_end)),
        .threads = threads,
        .back_end = options_.back_end};
  }

  /// Traces the rays of a tile. @return the number of its samples
  std::size_t trace_tile(unsigned x0, unsigned y0, Worker& own) {
    own.samples.clear();
    own.directions.clear();
    for (unsigned i = 0; i < kTileSide * kTileSide; ++i) {
      const unsigned x = x0 + even_bits(i), y = y0 + even_bits(i >> 1);
      if (x >= area_.x1 || y >= area_.y1) continue;
      own.samples.push_back(place_of(x, y));
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
  const SurfelViewOptions options_;
  const Executor& executor_;
  SceneView view_;
  std::vector<std::uint8_t> rise_groups_;
  SampleRect seen_;                   ///< what at() knows
  std::unique_ptr<PageCache> cache_;  ///< null before the first ray, and when all is seen
  std::vector<std::unique_ptr<Worker>> workers_;  ///< by thread
};

}  // namespace

std::unique_ptr<PrimaryView> view_surfels(const ContainerReader& scene, const Camera& camera,
                                          const SurfelViewOptions& options,
                                          const Executor& executor, Progress& progress) {
  auto view = std::make_unique<CloudView>(scene, camera, options, executor);
  if (view->holds_all()) view->look_at_all(progress);
  return view;
}

double sparse_share(const ContainerReader& scene, const Camera& camera,
                    const SurfelViewOptions& options, const Executor& executor) {
  // A picture that is this many times coarser, but has 64 samples along a side if there are so many
  const unsigned width = camera.width * options.side, height = camera.height * options.side;
  const unsigned step = std::clamp(std::max(width, height) / 64, 1U, 16U);
  Camera coarse = camera;
  coarse.width = std::max(1U, width / step);
  coarse.height = std::max(1U, height / step);
  SurfelViewOptions with = options;
  with.side = 1;
  const auto finer = static_cast<float>(height) / static_cast<float>(coarse.height);
  return CloudView(scene, coarse, with, executor).sparse_share(finer);
}

std::uint64_t depth_bytes_for(unsigned width, unsigned height) noexcept {
  return (width + std::uint64_t{2} * kHoleReach) * (height + std::uint64_t{2} * kHoleReach) *
         kSplatBytes;
}

std::uint64_t view_bytes(const ContainerReader& scene, unsigned threads, BackEnd back_end) {
  constexpr std::uint64_t kPages = std::uint64_t{16} << 20;
  return threads * CameraTracer::kBytes +
         std::max(kPages, PageCache::min_bytes(scene, threads, back_end));
}

}  // namespace ptc
