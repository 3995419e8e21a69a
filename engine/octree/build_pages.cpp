// Takes the points block by block. A block is a whole number of pages, so that page boundaries, and
// with them the sums of the superblock, do not depend on how the stream delivers its points. While
// the writer encodes the pages of one block, the next is read and built.
#include "engine/octree/build_pages.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "engine/octree/octree.h"
#include "engine/octree/page_order.h"
#include "engine/octree/square_sum.h"
#include "engine/sort/point_streams.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kPointsAtOnce = std::size_t{1} << 16;  // points of a block, in whole pages

/// Bounds and sums of points, as the superblock records them.
struct Totals {
  std::array<double, 3> low{}, high{};
  SquareSum radii;
  std::array<double, 3> flux{};
};

/// Returns the totals of one page.
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
    totals.radii.add(points.radius(i));
    const Half3 radiance = points.radiance(i), emission = points.emission(i);
    for (std::size_t c = 0; c < 3; ++c) {
      totals.flux[c] +=
          area * (double{decode_half(radiance[c])} + double{decode_half(emission[c])});
    }
  }
  totals.low = frame.to_position(low);
  totals.high = frame.to_position(high);
  return totals;
}

/// Adds the totals of one page to the superblock, but for the area. Pages are added in their order,
/// so that the flux depends on the points and the page size alone.
void include(Superblock& superblock, const Totals& page, std::uint64_t points) {
  const bool first = superblock.points == 0;
  for (std::size_t k = 0; k < 3; ++k) {
    superblock.bounds_low[k] =
        first ? page.low[k] : std::min(superblock.bounds_low[k], page.low[k]);
    superblock.bounds_high[k] =
        first ? page.high[k] : std::max(superblock.bounds_high[k], page.high[k]);
    superblock.flux[k] += page.flux[k];
  }
  superblock.points += points;
}

/// Waits for pages that are still being written when a build ends in any way, because they use its
/// executor.
class Settled {
 public:
  explicit Settled(ContainerWriter& writer) : writer_(writer) {}
  Settled(const Settled&) = delete;
  Settled& operator=(const Settled&) = delete;
  ~Settled() {
    // A build that succeeds has flushed before, and one that fails throws its own error.
    try {
      writer_.flush();
    } catch (...) {
    }
  }

 private:
  ContainerWriter& writer_;
};

/// Encodes the points of a block as pages, and adds their totals to the superblock.
void add_block(std::span<const PointRecord> block, const FileHeader& file, const Executor& executor,
               Superblock& superblock, SquareSum& radii, PageOrder& order) {
  const std::size_t per_page = points_per_page(file);
  std::vector<ContainerWriter::Page> pages((block.size() - 1) / per_page + 1);
  std::vector<Totals> totals(pages.size());
  executor.for_each(pages.size(), [&](std::size_t i, unsigned) {
    const auto page = block.subspan(i * per_page, std::min(per_page, block.size() - i * per_page));
    pages[i] = point_page(page, file.point_bytes);
    const PointPage points(pages[i].payload.data(), pages[i].summary.record_count,
                           file.point_bytes);
    totals[i] = totals_of(points, file.frame);
  });
  for (std::size_t i = 0; i < pages.size(); ++i) {
    include(superblock, totals[i], pages[i].summary.record_count);
    radii.add(totals[i].radii);
    order.add(std::move(pages[i]));
  }
}

void save_totals(const Superblock& superblock, const SquareSum& radii, StateWriter& state) {
  state.put(superblock.points);
  radii.save(state);
  for (const auto& numbers : {superblock.bounds_low, superblock.bounds_high, superblock.flux})
    state.put(numbers);
}

void load_totals(StateReader& state, Superblock& superblock, SquareSum& radii) {
  superblock.points = state.get<std::uint64_t>();
  radii.load(state);
  for (auto* numbers : {&superblock.bounds_low, &superblock.bounds_high, &superblock.flux}) {
    *numbers = state.get<std::array<double, 3>>();
  }
}

}  // namespace

std::uint64_t held_pages_bytes(std::uint8_t page_shift) noexcept {
  return PageOrder::held_limit(page_shift) + PageOrder::leaving_limit(page_shift);
}

Superblock build_pages(PointStream& points, ContainerWriter& writer, const BuildOptions& options,
                       const Executor& executor, Progress& progress, const Checkpoints& checkpoints,
                       TreeEdges* edges) {
  // Begin with nothing, or where the checkpoint was made.
  const FileHeader& file = writer.header();
  Superblock superblock;
  superblock.leaf_points = options.leaf_points;
  SquareSum radii;

  const std::uint32_t per_page = points_per_page(file);
  const Settled settled(writer);
  PageOrder order(writer, per_page, options.levels_per_stream);
  OctreeBuilder octree(order, options.leaf_points, file.frame.unit(), executor);
  if (edges != nullptr) octree.record_edges();
  if (checkpoints.from != nullptr) {
    load_totals(*checkpoints.from, superblock, radii);
    order.load(*checkpoints.from, superblock.points);
    octree.load(*checkpoints.from, [&](std::uint32_t page) { return order.knows(page); });
  }
  // Build pages and tree block by block.
  std::uint64_t saved = superblock.points;
  std::vector<PointRecord> block(std::max<std::size_t>(kPointsAtOnce / per_page, 1) * per_page);
  while (const std::size_t count = read_full(points, block)) {
    add_block(std::span(block).first(count), file, executor, superblock, radii, order);
    octree.add(std::span(block).first(count));
    writer.write_pages(order.take(), executor);
    progress.advance(count);
    // Make a checkpoint when one is due, but none after the last, partial block.
    if (!checkpoints.save || superblock.points - saved < checkpoints.interval ||
        count < block.size())
      continue;
    saved = superblock.points;
    StateWriter state;
    save_totals(superblock, radii, state);
    order.save(state);
    octree.save(state);
    checkpoints.save({superblock.points, block.back().key}, state.take());
  }
  // Close the tree, write the pages that are left, and fill in the counts.
  const OctreeBuilder::Result tree = octree.finish();
  order.finish();
  writer.write_pages(order.take(), executor);
  order.finish_held(executor);

  superblock.area = 2 * radii.value();
  superblock.nodes = tree.nodes;
  superblock.node_groups = tree.groups;
  superblock.levels = static_cast<std::uint16_t>(tree.levels);
  if (tree.root.interior) {
    const ChildRef root = order.placed(tree.root);
    superblock.root_page = root.page;
    superblock.root_slot = root.slot;
  }
  if (edges != nullptr) {
    *edges = octree.take_edges();
    edges->place([&](const ChildRef& ref) { return order.placed(ref); });
    edges->radii = radii;
  }
  return superblock;
}

}  // namespace ptc
