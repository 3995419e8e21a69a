// One walk over the octree serves all receivers of a cell. What looks the same from everywhere in
// the cell is drawn once, into the cell's direction buffer; what does not is left in lists, which
// the cell's children test again with their smaller extent:
//
//   cell        stack: root ... -> draws far clusters, leaves near ones
//   +- child    draws some of what was left, opens others, leaves the rest
//      +- receiver   draws or opens all that is left, then integrates its hemisphere
#include "engine/shade/gather/gather.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include <glm/common.hpp>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

// Calls `body` with the receivers of each occupied child of the smallest octree cell that holds
// them all. Coincident receivers are handed over one by one.
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

}  // namespace

Gather::Gather(const SceneView& view, PageCache& cache, const GatherOptions& options,
               const VisibilityMaker& visibility, std::size_t things_left)
    : scene_(view, cache),
      options_(options),
      things_left_(things_left),
      empty_(options.resolution, options.bleeding),
      leaf_(options.resolution, options.bleeding) {
  empty_.clear();
  const Surroundings& around = options.around;
  if (around.is_plain()) {
    if (visibility) openings_.emplace(visibility(view, cache));
    return;
  }
  weights_.emplace(PixelWeights{.sphere = around.sphere,
                                .cone_cos = std::max(0.0F, std::cos(around.cone)),
                                .falloff = around.falloff});
  const double distance = view.scale().length(static_cast<double>(around.distance));
  if (std::isfinite(distance)) weights_->per_distance = static_cast<float>(1 / distance);
}

void Gather::shade(std::span<const Receiver> receivers, std::span<Shading> results,
                   const DirectionGrid& grid, std::span<const float> weights) {
  if (receivers.empty()) return;
  grid_ = &grid;
  given_ = receivers;
  if (openings_) openings_->forget();
  place(receivers);
  sum_weights(weights);
  results_ = results;
  payloads_.clear();
  stack_.assign(1, scene_.view().root());
  shade_cell(receivers_, empty_, 0, 0);
}

void Gather::place(std::span<const Receiver> from) {
  const Frame& frame = scene_.view().frame();
  const double scale = 1 / frame.unit();
  const glm::dvec3 origin(frame.origin[0], frame.origin[1], frame.origin[2]);
  constexpr double kFarthest = SceneScale::kMaxDistance / SceneScale::kLatticeUnit;
  receivers_.clear();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const glm::dvec3& p = from[i].position;
    receivers_.push_back({.key = receiver_key(frame, p, grid_->variant()),
                          .position = glm::clamp((p - origin) * scale, -kFarthest, kFarthest),
                          .normal = from[i].normal,
                          .index = i});
  }
  std::ranges::sort(receivers_, [](const PlacedReceiver& a, const PlacedReceiver& b) {
    return a.key != b.key ? a.key < b.key : a.index < b.index;
  });
}

void Gather::sum_weights(std::span<const float> weights) {
  weight_before_.clear();
  work_ = {};
  if (weights.empty()) return;
  double sum = 0;
  for (const PlacedReceiver& receiver : receivers_) {
    weight_before_.push_back(sum);
    sum += static_cast<double>(weights[receiver.index]);
  }
  weight_before_.push_back(sum);
  work_.receivers = sum;
}

// The weight of the receivers of a cell; their number, where all have results.
double Gather::weight_of(std::span<const PlacedReceiver> cell) const {
  if (weight_before_.empty()) return static_cast<double>(cell.size());
  const auto first = static_cast<std::size_t>(cell.data() - receivers_.data());
  return weight_before_[first + cell.size()] - weight_before_[first];
}

// Adds what a cell took, shared among its receivers.
void Gather::add_work(std::span<const PlacedReceiver> cell, const GatherCounts& before) {
  if (weight_before_.empty()) return;
  const double share = weight_of(cell) / static_cast<double>(cell.size());
  const auto of = [&](std::uint64_t GatherCounts::*count) {
    return share * static_cast<double>(counts_.*count - before.*count);
  };
  work_.surfel_blocks += of(&GatherCounts::surfel_blocks);
  work_.clusters += of(&GatherCounts::clusters);
}

// Shades the receivers of one cell, with what is on the stack and what the cell around it left.
// `inherited` is what the cells around this one have drawn; `bound`, what the stand-ins for lost
// nodes in it may change at most.
void Gather::shade_cell(std::span<const PlacedReceiver> cell, const DirectionBuffer& inherited,
                        std::size_t depth, float bound) {
  if (weight_of(cell) == 0) return;
  ReceiverCell bounds(cell);
  if (options_.around.sphere) bounds.has_horizon = false;
  const GatherCounts counted = counts_;
  if (cell.size() == 1) {
    const DirectionBuffer& drawn = collect(bounds, inherited, leaf_, nullptr, depth, bound);
    add_work(cell, counted);
    resolve(cell, drawn, depth, bound);
    return;
  }
  if (depth + 1 == kViewpoints) {  // cells within cells beyond what a pixel can name: one by one
    for (std::size_t i = 0; i < cell.size(); ++i)
      shade_cell(cell.subspan(i, 1), inherited, depth, bound);
    return;
  }
  ++counts_.cells;
  if (depth == levels_.size()) levels_.push_back(std::make_unique<Level>(options_));
  Level& level = *levels_[depth];
  level.centre = bounds.centre;
  level.left.clear();
  const std::size_t before = payloads_.size();
  const DirectionBuffer& drawn =
      collect(bounds, inherited, level.buffer, &level.left, depth, bound);
  add_work(cell, counted);
  if (level.left.size() == 0) {
    resolve(cell, drawn, depth + 1, bound);
  } else {
    split(cell, [&](std::span<const PlacedReceiver> child) {
      shade_cell(child, drawn, depth + 1, bound);
    });
  }
  payloads_.resize(before);
}

// Integrates the drawn pixels for each receiver of a cell. The pixels of the `depth` cells around
// them are seen from each receiver's own place.
void Gather::resolve(std::span<const PlacedReceiver> cell, const DirectionBuffer& drawn,
                     std::size_t depth, float bound) {
  std::array<glm::vec3, kViewpoints> offsets{};
  std::size_t wanted = 0;
  for (std::size_t k = 0; k < cell.size(); ++k) {
    const double weight = weight_of(cell.subspan(k, 1));
    if (weight == 0) continue;
    ++wanted;
    const PlacedReceiver& receiver = cell[k];
    for (std::size_t i = 0; i < depth; ++i) {
      offsets[i] = glm::vec3((receiver.position - levels_[i]->centre) * SceneScale::kLatticeUnit);
    }
    Shading& result = results_[receiver.index];
    result = drawn.resolve(*grid_, receiver.normal, std::span(offsets).first(depth),
                           weights_ ? &*weights_ : nullptr);
    // Rays would pass through what stand-ins cover
    if (!openings_ || !grid_->has_sky() || bound > 0) continue;
    const std::uint64_t rays = openings_->mend(*grid_, drawn, given_[receiver.index], result);
    counts_.rays += rays;
    if (!weight_before_.empty()) work_.rays += weight * static_cast<double>(rays);
  }
  counts_.receivers += wanted;
  if (bound > 0) counts_.damage.add(wanted, std::min(1.0F, bound));
}

// Tests what is on the stack and what the cell around left. Draws what looks the same to all
// receivers of the cell; the rest goes to `left`, for the cell's children. Without `left`, the cell
// has a single receiver, and everything is drawn. `bound` grows by what stand-ins may cover.
//
// Returns `own`, a copy of `inherited` with this cell's drawing, or `inherited` itself when nothing
// was drawn.
const DirectionBuffer& Gather::collect(const ReceiverCell& cell, const DirectionBuffer& inherited,
                                       DirectionBuffer& own, NearLists* left, std::size_t depth,
                                       float& bound) {
  const SceneScale& scale = scene_.view().scale();
  CellTest test{
      .cell = cell,
      .lengths = scale.length_factors(),
      .areas = scale.area_factors(),
      .limit = options_.solid_angle / kPi,
      .shared_from =
          left ? std::min(std::numeric_limits<float>::max(), cell.radius / options_.parallax) : 0,
      .inflation = options_.inflation,
      .sides = options_.sides,
      .bleeding = options_.bleeding,
      .emission = options_.emission,
      .last = left == nullptr,
      .damaged = scene_.view().lost() != nullptr};
  CellOutput out{queue_, left, payloads_};
  WalkLimit limit(scene_.view());
  const Horizon horizon = cell.has_horizon ? Horizon{cell.axis, cell.cone_sin} : Horizon{};
  bool touched = false;
  const auto flush = [&] {
    if (queue_.size == 0) return;
    if (!touched) own.copy(inherited);
    touched = true;
    own.draw(*grid_, queue_, options_.sides, static_cast<unsigned>(depth), horizon);
    queue_.size = 0;
  };
  // Without a limit, a cell of receivers that lie far apart leaves all surfels between them. A low
  // limit costs time: what a cell does not open is opened in several of the cells within. A cell
  // that has left half as much again leaves all clusters that it would open
  const auto kept_within = [&] {
    const std::size_t things = left ? left->size() + opened_.size() : 0;
    if (things > things_left_ + things_left_ / 2) return std::numeric_limits<float>::infinity();
    return things > things_left_ ? test.shared_from : 0;
  };
  const auto walk = [&] {  // the tree below what is on the stack
    while (!stack_.empty()) {
      const ChildRef next = stack_.back();
      stack_.pop_back();
      if (next.interior) {
        limit.take_group();
        test.kept_within = kept_within();
        look_at_group(next, test, out);
      } else {
        limit.take_points(next.point_count);
        look_at_run(next, test, out, flush);
      }
      if (queue_.full()) flush();
    }
  };
  opened_.clear();
  if (depth == 0) {
    walk();
  } else {
    // Test what the cell around left
    const Level& around = *levels_[depth - 1];
    const NearClusters& clusters = around.left.clusters;
    const glm::vec3 move((around.centre - cell.centre) * SceneScale::kLatticeUnit);
    for (std::size_t i = 0; i < clusters.size; flush())
      i = look_at_clusters(around, i, move, test, out);
    for (std::size_t i = 0; i < around.left.surfels.size; flush())
      i = look_at_surfels(around, i, move, test, out);
    // Walk below those that are to be opened, or leave them to the children
    while (!opened_.empty()) {
      const std::uint32_t i = opened_.back();
      opened_.pop_back();
      if (clusters.is_within(kept_within(), i, move)) {
        left->clusters.take(clusters, i, move);
      } else {
        push(payloads_[clusters.payload[i]]);
        walk();
      }
    }
  }
  flush();
  bound += out.stand_in_share;
  counts_.damage.stand_ins += out.stand_ins;
  return touched ? own : inherited;
}

std::size_t Gather::look_at_clusters(const Level& around, std::size_t from, const glm::vec3& move,
                                     const CellTest& test, CellOutput& out) {
  const int before = queue_.size;
  const std::size_t next = gather_clusters(around.left.clusters, from, move, test, out, opened_);
  counts_.clusters += static_cast<unsigned>(queue_.size - before);
  counts_.retests += next - from;
  return next;
}

std::size_t Gather::look_at_surfels(const Level& around, std::size_t from, const glm::vec3& move,
                                    const CellTest& test, CellOutput& out) {
  const int before = queue_.size;
  const std::size_t next = gather_surfels(around.left.surfels, from, move, test, out);
  counts_.surfels += static_cast<unsigned>(queue_.size - before);
  counts_.retests += next - from;
  return next;
}

std::size_t Gather::list_bytes() const noexcept {
  std::size_t bytes = payloads_.capacity() * sizeof(ClusterPayload);
  for (const auto& level : levels_)
    bytes += level->left.clusters.bytes() + level->left.surfels.bytes();
  return bytes;
}

void Gather::push(const ClusterPayload& payload) {
  const std::uint64_t word = std::uint64_t{payload.reference[1]} << 32 | payload.reference[0];
  stack_.push_back(decode_reference(word, (payload.kind & kInterior) != 0));
}

void Gather::look_at_group(const ChildRef& reference, const CellTest& test, CellOutput& out) {
  ++counts_.groups;
  const unsigned closed = test.damaged ? scene_.lost_children(reference.page, reference.slot) : 0;
  const PinnedGroup group = scene_.group(reference.page, reference.slot);
  const int before = queue_.size;
  const unsigned open = gather_group(*group, closed, test, out);
  counts_.clusters += static_cast<unsigned>(queue_.size - before);
  for (unsigned rest = open; rest != 0; rest &= rest - 1)
    stack_.push_back(group->child(std::countr_zero(rest)));
}

// Tests the points of a leaf, in runs of up to 8 that do not cross a page.
template <class Flush>
void Gather::look_at_run(const ChildRef& leaf_node, const CellTest& test, CellOutput& out,
                         const Flush& flush) {
  const std::uint32_t per_page = scene_.view().points_per_page();
  const bool emits = scene_.view().point_bytes() != kPointBytes;
  std::uint64_t first = leaf_node.first_point;
  for (const std::uint64_t end = first + leaf_node.point_count; first < end;) {
    const auto slot = static_cast<std::uint32_t>(first % per_page);
    const auto number =
        static_cast<unsigned>(std::min<std::uint64_t>({8, end - first, per_page - slot}));
    ++counts_.surfel_blocks;
    const PageGuard page = scene_.points(first);
    if (queue_.full()) flush();
    const int before = queue_.size;
    gather_page_surfels(page.payload(), page.record_count(), emits, slot, number, test, out);
    counts_.surfels += static_cast<unsigned>(queue_.size - before);
    first += number;
  }
}

void GatherCounts::add(const GatherCounts& other) noexcept {
  receivers += other.receivers;
  cells += other.cells;
  groups += other.groups;
  surfel_blocks += other.surfel_blocks;
  clusters += other.clusters;
  surfels += other.surfels;
  retests += other.retests;
  rays += other.rays;
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
