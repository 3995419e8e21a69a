#include "engine/shade/gather/gather.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <vector>

#include <glm/common.hpp>

#include "engine/base/numbers.h"
#include "engine/shade/kernels/gather_kernels.h"

namespace ptc {
namespace {

/// One depth of receiver cells: what the current cell there draws and leaves.
struct Level {
  explicit Level(const GatherOptions& options) : buffer(options.resolution, options.bleeding) {}

  glm::dvec3 centre{0};  // lattice units
  DirectionBuffer buffer;
  NearLists left;
};

}  // namespace

struct Gather::Impl {
  SceneReader scene;
  GatherOptions options;
  const DirectionGrid* grid = nullptr;  // of the call
  GatherCounts counts;
  std::vector<PlacedReceiver> receivers;
  std::span<Shading> results;
  std::vector<std::unique_ptr<Level>> levels;  // by depth, made when first needed
  std::vector<ClusterPayload>
      payloads;  // of the clusters that the current cells left, outer cells first
  std::vector<ChildRef> stack;
  std::vector<std::uint32_t> opened;
  DirectionBuffer empty, leaf;
  DiscQueue queue;

  Impl(const SceneView& view, PageCache& cache, const GatherOptions& o)
      : scene(view, cache),
        options(o),
        empty(o.resolution, o.bleeding),
        leaf(o.resolution, o.bleeding) {
    empty.clear();
  }

  void place(std::span<const Receiver> from) {
    const Frame& frame = scene.view().frame();
    const double scale = 1 / frame.unit();
    const glm::dvec3 origin(frame.origin[0], frame.origin[1], frame.origin[2]);
    constexpr double kFarthest = SceneScale::kMaxDistance / SceneScale::kLatticeUnit;
    receivers.clear();
    for (std::size_t i = 0; i < from.size(); ++i) {
      const glm::dvec3& p = from[i].position;
      receivers.push_back({.key = receiver_key(frame, p, grid->variant()),
                           .position = glm::clamp((p - origin) * scale, -kFarthest, kFarthest),
                           .normal = from[i].normal,
                           .index = i});
    }
    std::ranges::sort(receivers, [](const PlacedReceiver& a, const PlacedReceiver& b) {
      return a.key != b.key ? a.key < b.key : a.index < b.index;
    });
  }

  void run() {
    payloads.clear();
    stack.assign(1, scene.view().root());
    shade_cell(receivers, empty, 0, 0);
  }

  /// What waits on the stack is looked at for this cell too.
  /// @param inherited  what the cells around this one have drawn
  /// @param bound      on what stand-ins among that change
  void shade_cell(std::span<const PlacedReceiver> cell, const DirectionBuffer& inherited,
                  std::size_t depth, float bound) {
    const ReceiverCell bounds(cell, SceneScale::kLatticeUnit);
    if (cell.size() == 1) {
      const DirectionBuffer& drawn = collect(bounds, inherited, leaf, nullptr, depth, bound);
      resolve(cell, drawn, depth, bound);
      return;
    }
    if (depth + 1 == kViewpoints) {  // cells within cells beyond what a pixel can name: one by one
      for (std::size_t i = 0; i < cell.size(); ++i)
        shade_cell(cell.subspan(i, 1), inherited, depth, bound);
      return;
    }
    ++counts.cells;
    if (depth == levels.size()) levels.push_back(std::make_unique<Level>(options));
    Level& level = *levels[depth];
    level.centre = bounds.centre;
    level.left.clear();
    const std::size_t before = payloads.size();
    const DirectionBuffer& drawn =
        collect(bounds, inherited, level.buffer, &level.left, depth, bound);
    if (level.left.empty()) {
      resolve(cell, drawn, depth + 1, bound);
    } else {
      split(cell, [&](std::span<const PlacedReceiver> child) {
        shade_cell(child, drawn, depth + 1, bound);
      });
    }
    payloads.resize(before);
  }

  /// Sums for receivers that see the same pixels.
  /// @param depth  of the cells around them: those whose pixels move as they see them
  /// @param bound  on what stand-ins change
  void resolve(std::span<const PlacedReceiver> cell, const DirectionBuffer& drawn,
               std::size_t depth, float bound) {
    std::array<glm::vec3, kViewpoints> offsets{};
    for (const PlacedReceiver& receiver : cell) {
      for (std::size_t i = 0; i < depth; ++i) {
        offsets[i] = glm::vec3((receiver.position - levels[i]->centre) * SceneScale::kLatticeUnit);
      }
      results[receiver.index] =
          drawn.resolve(*grid, receiver.normal, std::span(offsets).first(depth));
    }
    counts.receivers += cell.size();
    if (bound > 0) counts.damage.add(cell.size(), std::min(1.0F, bound));
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

  /// Looks at the stack and at what the cell around left. Draws what is settled for all receivers
  /// of the cell; the rest goes to `left`, for its children. Without `left` everything is settled.
  /// @param bound  grows by what stand-ins may cover
  /// @return  `own`, a copy of `inherited` that was drawn into; `inherited` when nothing was
  const DirectionBuffer& collect(const ReceiverCell& cell, const DirectionBuffer& inherited,
                                 DirectionBuffer& own, NearLists* left, std::size_t depth,
                                 float& bound) {
    const SceneScale& scale = scene.view().scale();
    const CellTest test{
        .cell = cell,
        .lengths = scale.length_factors(),
        .areas = scale.area_factors(),
        .limit = options.solid_angle / kPi,
        .shared_from =
            left ? std::min(std::numeric_limits<float>::max(), cell.radius / options.parallax) : 0,
        .inflation = options.inflation,
        .sides = options.sides,
        .bleeding = options.bleeding,
        .last = left == nullptr,
        .damaged = scene.view().lost() != nullptr};
    CellOutput out{queue, left, payloads};
    WalkLimit limit(scene.view());
    const Horizon horizon = cell.has_horizon ? Horizon{cell.axis, cell.cone_sin} : Horizon{};
    bool touched = false;
    const auto flush = [&] {
      if (queue.size == 0) return;
      if (!touched) own.copy(inherited);
      touched = true;
      own.draw(*grid, queue, options.sides, static_cast<unsigned>(depth), horizon);
      queue.size = 0;
    };
    if (depth > 0) {
      const Level& around = *levels[depth - 1];
      const glm::vec3 move((around.centre - cell.centre) * SceneScale::kLatticeUnit);
      opened.clear();
      for (std::size_t i = 0; i < around.left.clusters.size; flush())
        i = look_at_clusters(around, i, move, test, out);
      for (std::size_t i = 0; i < around.left.surfels.size; flush())
        i = look_at_surfels(around, i, move, test, out);
      for (const std::uint32_t i : opened) push(payloads[i]);
    }
    while (!stack.empty()) {
      const ChildRef next = stack.back();
      stack.pop_back();
      if (next.interior) {
        limit.take_group();
        look_at_group(next, test, out);
      } else {
        limit.take_points(next.point_count);
        look_at_run(next, test, out, flush);
      }
      if (queue.full()) flush();
    }
    flush();
    bound += out.stand_in_share;
    counts.damage.stand_ins += out.stand_ins;
    return touched ? own : inherited;
  }

  std::size_t look_at_clusters(const Level& around, std::size_t from, const glm::vec3& move,
                               const CellTest& test, CellOutput& out) {
    const int before = queue.size;
    const std::size_t next = gather_clusters(around.left.clusters, from, move, test, out, opened);
    counts.clusters += static_cast<unsigned>(queue.size - before);
    counts.retests += next - from;
    return next;
  }

  std::size_t look_at_surfels(const Level& around, std::size_t from, const glm::vec3& move,
                              const CellTest& test, CellOutput& out) {
    const int before = queue.size;
    const std::size_t next = gather_surfels(around.left.surfels, from, move, test, out);
    counts.surfels += static_cast<unsigned>(queue.size - before);
    counts.retests += next - from;
    return next;
  }

  void push(const ClusterPayload& payload) {
    const std::uint64_t word = std::uint64_t{payload.reference[1]} << 32 | payload.reference[0];
    stack.push_back(decode_reference(word, (payload.kind & kInterior) != 0));
  }

  void look_at_group(const ChildRef& reference, const CellTest& test, CellOutput& out) {
    ++counts.groups;
    const unsigned closed = test.damaged ? scene.lost_children(reference.page, reference.slot) : 0;
    const GroupView group = scene.group(reference.page, reference.slot);
    const int before = queue.size;
    const unsigned open = gather_group(group, closed, test, out);
    counts.clusters += static_cast<unsigned>(queue.size - before);
    for (unsigned rest = open; rest != 0; rest &= rest - 1)
      stack.push_back(group.child(std::countr_zero(rest)));
  }

  /// The points of a leaf, in runs of 8 that do not cross a page.
  template <class Flush>
  void look_at_run(const ChildRef& leaf_node, const CellTest& test, CellOutput& out,
                   const Flush& flush) {
    const std::uint32_t per_page = scene.view().points_per_page();
    std::uint64_t first = leaf_node.first_point;
    for (const std::uint64_t end = first + leaf_node.point_count; first < end;) {
      const auto slot = static_cast<std::uint32_t>(first % per_page);
      const auto number =
          static_cast<unsigned>(std::min<std::uint64_t>({8, end - first, per_page - slot}));
      ++counts.surfel_blocks;
      const PageReader::Page page = scene.points(first);
      if (queue.full()) flush();
      const int before = queue.size;
      gather_page_surfels(page.payload, page.record_count, slot, number, test, out);
      counts.surfels += static_cast<unsigned>(queue.size - before);
      first += number;
    }
  }
};

Gather::Gather(const SceneView& view, PageCache& cache, const GatherOptions& options)
    : impl_(std::make_unique<Impl>(view, cache, options)) {}
Gather::~Gather() = default;

void Gather::shade(std::span<const Receiver> receivers, std::span<Shading> results,
                   const DirectionGrid& grid) {
  if (receivers.empty()) return;
  impl_->grid = &grid;
  impl_->place(receivers);
  impl_->results = results;
  impl_->run();
}

const GatherCounts& Gather::counts() const noexcept {
  return impl_->counts;
}

void GatherCounts::add(const GatherCounts& other) noexcept {
  receivers += other.receivers;
  cells += other.cells;
  groups += other.groups;
  surfel_blocks += other.surfel_blocks;
  clusters += other.clusters;
  surfels += other.surfels;
  retests += other.retests;
  damage.add(other.damage);
}

void DamageCounts::add(std::uint64_t more, float bound) noexcept {
  receivers += more;
  max_bound = std::max(max_bound, static_cast<double>(bound));
  bounds += more * static_cast<std::uint64_t>(static_cast<double>(bound) / kBoundUnit);
}

void DamageCounts::add(const DamageCounts& other) noexcept {
  stand_ins += other.stand_ins;
  receivers += other.receivers;
  max_bound = std::max(max_bound, other.max_bound);
  bounds += other.bounds;
}

}  // namespace ptc
