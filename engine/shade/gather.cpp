#include "engine/shade/gather.h"

#include <algorithm>
#include <bit>
#include <array>
#include <vector>

#include "engine/shade/gather_kernels.h"

namespace ptc {
namespace {

constexpr float kPi = 3.14159265F;

/// Work left for the children of a receiver cell: some children of a group, or some surfels.
struct Entry {
  std::uint64_t first = 0;  // surfels: index of the first
  std::uint32_t page = 0;   // group
  std::uint16_t slot = 0;
  std::uint8_t mask = 0;    // which of up to 8
  bool surfels = false;
};

constexpr std::uint8_t kAll = 0xff;  // a group may have fewer than 8: its size limits the mask

}  // namespace

struct Gather::Impl {
  SceneReader scene;
  GatherOptions options;
  const DirectionGrid* grid = nullptr;  // of the call
  GatherCounts counts;
  std::vector<PlacedReceiver> receivers;
  std::span<Shading> results;
  std::vector<std::unique_ptr<DirectionBuffer>> buffers;  // one per depth of receiver cells
  std::vector<std::vector<Entry>> lists;                  // likewise
  std::vector<Entry> stack;
  DirectionBuffer leaf;
  DiscQueue queue;
  std::array<glm::dvec3, kViewpoints> centres;  // of the cells around the current one, lattice units

  Impl(const SceneView& view, PageCache& cache, const GatherOptions& o)
      : scene(view, cache), options(o), leaf(o.resolution) {}

  void place(std::span<const Receiver> from) {
    const Frame& frame = scene.view().frame();
    const double scale = 1 / frame.unit();
    const glm::dvec3 origin(frame.origin[0], frame.origin[1], frame.origin[2]);
    receivers.clear();
    for (std::size_t i = 0; i < from.size(); ++i) {
      const glm::dvec3& p = from[i].position;
      receivers.push_back({.key = receiver_key(frame, p, grid->variant()),
                           .position = (p - origin) * scale,
                           .normal = from[i].normal,
                           .index = i});
    }
    std::ranges::sort(receivers, [](const PlacedReceiver& a, const PlacedReceiver& b) {
      return a.key != b.key ? a.key < b.key : a.index < b.index;
    });
  }

  void run() {
    const ChildRef& root = scene.view().root();
    std::vector<Entry> all;
    if (root.interior) {
      all.push_back({.page = root.page, .slot = root.slot, .mask = kAll});
    }
    leaf.clear();
    shade_cell(receivers, all, leaf, 0);
  }

  /// @param inherited  what the cells around this one have drawn; may be the leaf buffer at depth 0
  void shade_cell(std::span<const PlacedReceiver> cell, const std::vector<Entry>& list,
                  const DirectionBuffer& inherited, std::size_t depth) {
    const ReceiverCell bounds(cell, scene.view().frame().unit());
    if (cell.size() == 1) {
      if (&inherited != &leaf) leaf.copy(inherited);
      collect(list, bounds, leaf, nullptr, depth);
      std::array<glm::vec3, kViewpoints> offsets{};
      for (std::size_t i = 0; i < depth; ++i) {
        offsets[i] = glm::vec3((bounds.centre - centres[i]) * scene.view().frame().unit());
      }
      results[cell[0].index] = leaf.resolve(*grid, cell[0].normal, std::span(offsets).first(depth));
      ++counts.receivers;
      return;
    }
    if (depth + 1 == kViewpoints) {  // cells within cells beyond what a pixel can name: one by one
      for (std::size_t i = 0; i < cell.size(); ++i) shade_cell(cell.subspan(i, 1), list, inherited, depth);
      return;
    }
    centres[depth] = bounds.centre;
    ++counts.cells;
    if (depth == buffers.size()) {
      buffers.push_back(std::make_unique<DirectionBuffer>(options.resolution));
      lists.emplace_back();
    }
    DirectionBuffer& buffer = *buffers[depth];
    buffer.copy(inherited);
    std::vector<Entry> left = std::move(lists[depth]);  // `lists` may grow below
    left.clear();
    collect(list, bounds, buffer, &left, depth);
    split(cell, [&](std::span<const PlacedReceiver> child) { shade_cell(child, left, buffer, depth + 1); });
    lists[depth] = std::move(left);
  }

  /// The occupied children of the smallest octree cell that holds the receivers; coincident
  /// receivers one by one.
  template <class Body>
  void split(std::span<const PlacedReceiver> cell, const Body& body) {
    const int level = common_level(cell.front().key, cell.back().key);
    for (std::size_t begin = 0; begin < cell.size();) {
      std::size_t end = begin + 1;
      if (level < kLatticeBits) {
        const int child = octant(cell[begin].key, level + 1);
        while (end < cell.size() && octant(cell[end].key, level + 1) == child) ++end;
      }
      body(cell.subspan(begin, end - begin));
      begin = end;
    }
  }

  /// Draws what is settled for all receivers of the cell; the rest goes to `left`, for its
  /// children. Without `left` (one receiver) everything is settled.
  void collect(const std::vector<Entry>& list, const ReceiverCell& cell, DirectionBuffer& buffer,
               std::vector<Entry>* left, std::size_t depth) {
    const auto viewpoint = static_cast<unsigned>(depth);
    const float shared_from = left ? cell.radius / options.parallax : 0;
    const CellTest test{.cell = cell,
                        .unit = scene.view().frame().unit(),
                        .limit = options.solid_angle / kPi,
                        .shared_from = shared_from,
                        .inflation = options.inflation,
                        .sides = options.sides,
                        .last = left == nullptr};
    stack.assign(list.begin(), list.end());
    while (!stack.empty()) {
      const Entry entry = stack.back();
      stack.pop_back();
      if (entry.surfels) {
        collect_surfels(entry, test, left);
      } else {
        collect_group(entry, test, left);
      }
      if (queue.full()) flush(buffer, viewpoint);
    }
    flush(buffer, viewpoint);
  }

  void flush(DirectionBuffer& buffer, unsigned viewpoint) {
    buffer.draw(*grid, queue, options.sides, viewpoint);
    queue.size = 0;
  }

  void collect_group(const Entry& entry, const CellTest& test, std::vector<Entry>* left) {
    ++counts.groups;
    const GroupView group = scene.group(entry.page, entry.slot);
    const int before = queue.size;
    const GroupVerdict verdict = gather_group(group, entry.mask, test, queue);
    counts.clusters += static_cast<unsigned>(queue.size - before);
    for (unsigned rest = verdict.open; rest != 0; rest &= rest - 1) open(group.child(std::countr_zero(rest)));
    if (verdict.keep != 0) {
      left->push_back({.page = entry.page, .slot = entry.slot, .mask = static_cast<std::uint8_t>(verdict.keep)});
    }
  }

  void open(const ChildRef& child) {
    if (child.interior) {
      stack.push_back({.page = child.page, .slot = child.slot, .mask = kAll});
      return;
    }
    // Runs of 8 that do not cross a page.
    const std::uint32_t per_page = scene.view().points_per_page();
    std::uint64_t first = child.first_point;
    for (const std::uint64_t end = first + child.point_count; first < end;) {
      const std::uint64_t page_left = per_page - first % per_page;
      const auto size = static_cast<unsigned>(std::min<std::uint64_t>({8, end - first, page_left}));
      stack.push_back({.first = first, .mask = static_cast<std::uint8_t>((1U << size) - 1), .surfels = true});
      first += size;
    }
  }

  void collect_surfels(const Entry& entry, const CellTest& test, std::vector<Entry>* left) {
    ++counts.surfel_blocks;
    const PageReader::Page page = scene.points(entry.first);
    const auto slot = static_cast<std::uint32_t>(entry.first % scene.view().points_per_page());
    const int before = queue.size;
    const unsigned keep = gather_surfels(page.payload, page.record_count, slot, entry.mask, test, queue);
    counts.surfels += static_cast<unsigned>(queue.size - before);
    if (keep != 0) left->push_back({.first = entry.first, .mask = static_cast<std::uint8_t>(keep), .surfels = true});
  }
};

Gather::Gather(const SceneView& view, PageCache& cache, const GatherOptions& options)
    : impl_(std::make_unique<Impl>(view, cache, options)) {}
Gather::~Gather() = default;

void Gather::shade(std::span<const Receiver> receivers, std::span<Shading> results, const DirectionGrid& grid) {
  if (receivers.empty()) return;
  impl_->grid = &grid;
  impl_->place(receivers);
  impl_->results = results;
  impl_->run();
}

const GatherCounts& Gather::counts() const noexcept { return impl_->counts; }

void GatherCounts::add(const GatherCounts& other) noexcept {
  receivers += other.receivers;
  cells += other.cells;
  groups += other.groups;
  surfel_blocks += other.surfel_blocks;
  clusters += other.clusters;
  surfels += other.surfels;
}

}  // namespace ptc
