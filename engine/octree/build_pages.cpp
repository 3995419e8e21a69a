#include "engine/octree/build_pages.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "engine/octree/octree.h"
#include "engine/octree/page_order.h"
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
    for (std::size_t c = 0; c < 3; ++c)
      totals.flux[c] += area * static_cast<double>(decode_half(radiance[c]));
  }
  totals.low = frame.to_position(low);
  totals.high = frame.to_position(high);
  return totals;
}

/// Adds the sums of one page after another, so that they depend on the page size and on nothing
/// else.
void include(Superblock& superblock, const Totals& page, std::uint64_t points) {
  const bool first = superblock.points == 0;
  for (std::size_t k = 0; k < 3; ++k) {
    superblock.bounds_low[k] =
        first ? page.low[k] : std::min(superblock.bounds_low[k], page.low[k]);
    superblock.bounds_high[k] =
        first ? page.high[k] : std::max(superblock.bounds_high[k], page.high[k]);
    superblock.flux[k] += page.flux[k];
  }
  superblock.area += page.area;
  superblock.points += points;
}

/// Waits for pages on their way when a build ends, however it does: they use its executor.
class Settled {
 public:
  explicit Settled(ContainerWriter& writer) : writer_(writer) {}
  Settled(const Settled&) = delete;
  Settled& operator=(const Settled&) = delete;
  ~Settled() {
    try {
      writer_.flush();
    } catch (...) {  // after flush() there are none; else what ended the build is on its way to the
                     // caller
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

/// The points of one call of OctreeBuilder::add(), and what they add to the superblock.
void add_block(std::span<const PointRecord> block, const Frame& frame, const Executor& executor,
               Superblock& superblock, PageOrder& order) {
  const std::size_t per_page = superblock.points_per_page;
  std::vector<ContainerWriter::Page> pages((block.size() - 1) / per_page + 1);
  std::vector<Totals> totals(pages.size());
  executor.for_each(pages.size(), [&](std::size_t i, unsigned) {
    const auto page = block.subspan(i * per_page, std::min(per_page, block.size() - i * per_page));
    pages[i] = point_page(page);
    totals[i] = totals_of(PointPage(pages[i].payload.data(), pages[i].summary.record_count), frame);
  });
  for (std::size_t i = 0; i < pages.size(); ++i) {
    include(superblock, totals[i], pages[i].summary.record_count);
    order.add(std::move(pages[i]));
  }
}

void save_totals(const Superblock& superblock, StateWriter& state) {
  state.put(superblock.points);
  state.put(superblock.area);
  for (const auto& numbers : {superblock.bounds_low, superblock.bounds_high, superblock.flux})
    state.put(numbers);
}

void load_totals(StateReader& state, Superblock& superblock) {
  superblock.points = state.get<std::uint64_t>();
  superblock.area = state.get<double>();
  for (auto* numbers : {&superblock.bounds_low, &superblock.bounds_high, &superblock.flux}) {
    *numbers = state.get<std::array<double, 3>>();
  }
}

}  // namespace

Superblock build_pages(PointStream& points, ContainerWriter& writer, const BuildOptions& options,
                       const Executor& executor, Progress& progress,
                       const Checkpoints& checkpoints) {
  const Frame& frame = writer.header().frame;
  Superblock superblock;
  superblock.leaf_points = options.leaf_points;
  superblock.points_per_page = points_per_page(writer.header());

  const std::size_t per_page = superblock.points_per_page;
  const Settled settled(writer);
  PageOrder order(writer, superblock.points_per_page, options.levels_per_stream);
  OctreeBuilder octree(order, options.leaf_points, frame.unit(), executor);
  if (checkpoints.from != nullptr) {
    load_totals(*checkpoints.from, superblock);
    order.load(*checkpoints.from, superblock.points);
    octree.load(*checkpoints.from, writer.state().pages);
  }
  std::uint64_t saved = superblock.points;
  std::vector<PointRecord> block(std::max<std::size_t>(kPointsAtOnce / per_page, 1) * per_page);
  while (const std::size_t count = read_full(points, block)) {
    add_block(std::span(block).first(count), frame, executor, superblock, order);
    octree.add(std::span(block).first(count));
    writer.write_pages(order.take(), executor);
    progress.advance(count);
    if (!checkpoints.save || superblock.points - saved < checkpoints.interval ||
        count < block.size())
      continue;
    saved = superblock.points;
    StateWriter state;
    save_totals(superblock, state);
    order.save(state);
    octree.save(state);
    checkpoints.save({superblock.points, block.back().key}, state.take());
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
