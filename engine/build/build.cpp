#include "engine/build/build.h"

#include <algorithm>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "engine/build/octree.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kPointsAtOnce = std::size_t{1} << 16;

/// What the superblock says of points.
struct Totals {
  std::array<double, 3> low{}, high{};
  double area = 0;
  std::array<double, 3> flux{};
};

Totals totals_of(const PointPage& points, const Frame& frame) {
  Totals totals;
  LatticePoint low = points.position(0), high = low;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const LatticePoint at = points.position(i);
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], at[k]);
      high[k] = std::max(high[k], at[k]);
    }
    const double radius = points.radius(i);
    const double area = 2.0 * radius * radius;
    totals.area += area;
    const std::array<std::uint16_t, 3> radiance = points.radiance(i);
    for (std::size_t c = 0; c < 3; ++c) totals.flux[c] += area * static_cast<double>(decode_half(radiance[c]));
  }
  totals.low = frame.to_position(low);
  totals.high = frame.to_position(high);
  return totals;
}

/// Adds the sums of one page after another, so that they depend on the page size and on nothing else.
void include(Superblock& superblock, const Totals& page, std::uint64_t points) {
  const bool first = superblock.points == 0;
  for (std::size_t k = 0; k < 3; ++k) {
    superblock.bounds_low[k] = first ? page.low[k] : std::min(superblock.bounds_low[k], page.low[k]);
    superblock.bounds_high[k] = first ? page.high[k] : std::max(superblock.bounds_high[k], page.high[k]);
    superblock.flux[k] += page.flux[k];
  }
  superblock.area += page.area;
  superblock.points += points;
}

using Page = ContainerWriter::Page;

Page point_page(std::span<const PointRecord> points) {
  return {.facts = {.type = PageType::point,
                    .record_count = static_cast<std::uint32_t>(points.size()),
                    .first_key = points.front().key.high,
                    .last_key = points.back().key.high},
          .payload = encode_point_page(points)};
}

/// Pages of points and nodes in the order of the file. A node page is there when it is full, one open page per
/// stream of levels; it gets its number when it is opened, so that parents can refer to groups that are not on the
/// disk yet. A point page comes before the groups that end in it.
class PageOrder : public GroupSink {
 public:
  PageOrder(ContainerWriter& writer, std::uint32_t points_per_page, int levels_per_stream)
      : writer_(writer),
        points_per_page_(points_per_page),
        levels_per_stream_(levels_per_stream),
        payload_limit_((std::size_t{1} << writer.header().page_shift) - kPageHeaderBytes),
        streams_(static_cast<std::size_t>(kMaxLevel / levels_per_stream + 1)) {}

  /// The next page of points; its number is given later.
  void add(Page points) { points_.push_back(std::move(points)); }

  ChildRef add(const GroupView& group, std::uint64_t end) override {
    while (!points_.empty() && next_point_ <= end) take_points();
    std::optional<Stream>& stream = streams_[static_cast<std::size_t>(group.level() / levels_per_stream_)];
    if (stream && !stream->encoder.fits(static_cast<std::size_t>(group.size()))) flush(stream);
    if (!stream) stream.emplace(Stream{writer_.reserve_page(), NodePageEncoder(payload_limit_)});
    stream->keys.include(group);
    return {.interior = true, .page = stream->page, .slot = stream->encoder.add(group)};
  }

  /// The pages that are whole.
  [[nodiscard]] std::vector<Page> take() noexcept { return std::exchange(whole_, {}); }

  /// Adds all others; of nodes those still open, deepest first: the coarse levels end up last in the file.
  void finish() {
    while (!points_.empty()) take_points();
    for (auto stream = streams_.rbegin(); stream != streams_.rend(); ++stream) {
      if (*stream) flush(*stream);
    }
  }

 private:
  struct Range {
    std::uint64_t first = ~std::uint64_t{0};
    std::uint64_t last = 0;
    std::uint16_t least_level = 0xffff;
    void include(const GroupView& group) {
      first = std::min(first, group.cell().high);
      last = std::max(last, group.cell().high);
      least_level = std::min(least_level, static_cast<std::uint16_t>(group.level()));
    }
  };
  struct Stream {
    std::uint32_t page;
    NodePageEncoder encoder;
    Range keys{};
  };

  void take_points() {
    whole_.push_back(std::move(points_.front()));
    whole_.back().id = writer_.reserve_page();
    points_.pop_front();
    next_point_ += points_per_page_;
  }

  void flush(std::optional<Stream>& stream) {
    whole_.push_back({.id = stream->page,
                      .facts = {.type = PageType::node,
                                .level = stream->keys.least_level,
                                .record_count = stream->encoder.size(),
                                .first_key = stream->keys.first,
                                .last_key = stream->keys.last},
                      .payload = stream->encoder.take()});
    stream.reset();
  }

  ContainerWriter& writer_;
  std::uint32_t points_per_page_;
  int levels_per_stream_;
  std::size_t payload_limit_;
  std::vector<std::optional<Stream>> streams_;
  std::deque<Page> points_;       ///< not yet taken
  std::uint64_t next_point_ = 0;  ///< first of these
  std::vector<Page> whole_;
};

/// Waits for pages on their way when a build ends, however it does: they use its executor.
class Settled {
 public:
  explicit Settled(ContainerWriter& writer) : writer_(writer) {}
  Settled(const Settled&) = delete;
  Settled& operator=(const Settled&) = delete;
  ~Settled() {
    try {
      writer_.flush();
    } catch (...) {  // after flush() there are none; else what ended the build is on its way to the caller
    }
  }

 private:
  ContainerWriter& writer_;
};

/// Fills `block` whole unless the stream ends.
std::size_t read_full(PointStream& points, std::span<PointRecord> block) {
  std::size_t filled = 0;
  while (filled < block.size()) {
    const std::size_t count = points.next(block.subspan(filled));
    if (count == 0) break;
    filled += count;
  }
  return filled;
}

}  // namespace

Superblock build_pages(PointStream& points, ContainerWriter& writer, const BuildOptions& options,
                       const Executor& executor, Progress& progress) {
  const Frame& frame = writer.header().frame;
  Superblock superblock;
  superblock.leaf_points = options.leaf_points;
  superblock.points_per_page = points_per_page(writer.header());

  const std::size_t per_page = superblock.points_per_page;
  const Settled settled(writer);
  PageOrder order(writer, superblock.points_per_page, options.levels_per_stream);
  OctreeBuilder octree(order, options.leaf_points, frame.unit(), executor);
  std::vector<PointRecord> block(std::max<std::size_t>(kPointsAtOnce / per_page, 1) * per_page);
  while (const std::size_t count = read_full(points, block)) {
    std::vector<Page> pages((count - 1) / per_page + 1);
    std::vector<Totals> totals(pages.size());
    executor.for_each(pages.size(), [&](std::size_t i, unsigned) {
      const auto page = std::span(block).subspan(i * per_page, std::min(per_page, count - i * per_page));
      pages[i] = point_page(page);
      totals[i] = totals_of(PointPage(pages[i].payload.data(), pages[i].facts.record_count), frame);
    });
    for (std::size_t i = 0; i < pages.size(); ++i) {
      include(superblock, totals[i], pages[i].facts.record_count);
      order.add(std::move(pages[i]));
    }
    octree.add(std::span(block).first(count));
    writer.write_pages(order.take(), executor);
    progress.advance(count);
  }
  const OctreeBuilder::Result tree = octree.finish();
  order.finish();
  writer.write_pages(order.take(), executor);
  writer.flush();

  superblock.nodes = tree.nodes;
  superblock.node_groups = tree.groups;
  superblock.levels = static_cast<std::uint16_t>(tree.levels);
  if (tree.root.interior) {
    superblock.root_page = tree.root.page;
    superblock.root_slot = tree.root.slot;
  }
  return superblock;
}

}  // namespace ptc
