// Cuts the arriving points into pieces, builds the pieces in parallel, and joins them in order.
//
// Two neighbouring points p, q determine the level of the smallest cell that holds both: the number
// of leading octal digits that their keys share. That level says which cells end between them:
//
//   p   0.3 5 1 7 ...
//   q   0.3 5 6 0 ...     shared = 2: cells below level 2 end after p, the cell of level 2 goes on
//
// So closing every open cell deeper than `shared`, and opening one at that level if there is none,
// keeps path_ the chain of cells around the current point. Below the lattice, digits of the rank
// among coincident points take the place of digits of the key.
#include "engine/octree/octree.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "engine/octree/node_state.h"
#include "engine/octree/page_order.h"

namespace ptc {

OctreeBuilder::OctreeBuilder(GroupSink& sink, std::uint32_t leaf_points, double unit,
                             const Executor& executor)
    : sink_(sink),
      executor_(executor),
      leaf_points_(leaf_points),
      piece_points_(std::max(leaf_points, kSubtreePoints)),
      unit_(unit),
      builders_(executor.threads(), SubtreeBuilder(leaf_points, unit)) {
  assert(leaf_points >= 1 && leaf_points <= kMaxLeafPoints);
}

void OctreeBuilder::add(std::span<const PointRecord> points) {
  window_.insert(window_.end(), points.begin(), points.end());
  build(false);
}

/// Returns the level of the smallest cell that holds the window's point `at`, whose rank is rank_,
/// and a later point `other`.
int OctreeBuilder::common(std::size_t at, std::size_t other) const {
  const int level = common_level(window_[at].key, window_[other].key);
  return level < kLatticeBits ? level : level + common_rank_level(rank_, rank_ + (other - at));
}

/// Returns the level of the smallest cell that holds the window's point `at` and the point before.
int OctreeBuilder::level_before(std::size_t at) const {
  const int level = common_level(last_key_, window_[at].key);
  return level < kLatticeBits ? level : level + common_rank_level(rank_ - 1, rank_);
}

/// Returns the points of a piece, which the window still has.
std::span<const PointRecord> OctreeBuilder::points_of(const Piece& piece) const {
  return std::span(window_).subspan(static_cast<std::size_t>(piece.first - window_first_),
                                    piece.count);
}

/// Returns a piece to fill, with the memory of one that was used before.
OctreeBuilder::Piece& OctreeBuilder::new_piece() {
  if (piece_count_ == pieces_.size()) pieces_.emplace_back();
  return pieces_[piece_count_++];
}

/// Cuts the front of the window into pieces. A piece is the largest cell that begins with the next
/// point, has at most piece_points_ points, and does not hold the point before. It is a node of the
/// tree, because the cell around it has more points than a leaf.
/// @param last  no more points will come, so that the rest of the window is complete
void OctreeBuilder::cut(bool last) {
  piece_count_ = 0;
  for (std::size_t at = 0; at < window_.size();) {
    // Find the rank of the next point, and the level of the largest cell that begins with it.
    const std::size_t reach = window_.size() - at;
    if (reach <= piece_points_ && !last) break;
    const bool begins = window_first_ + at == 0;
    rank_ = begins || window_[at].key != last_key_ ? 0 : last_rank_ + 1;
    const int before = begins ? -1 : level_before(at);
    const int level =
        1 + (reach > piece_points_ ? std::max(before, common(at, at + piece_points_)) : before);
    // Find the last point of that cell by bisection.
    std::size_t inside = at;
    for (std::size_t outside = at + std::min(reach, piece_points_); outside - inside > 1;) {
      const std::size_t middle = inside + (outside - inside) / 2;
      (common(at, middle) >= level ? inside : outside) = middle;
    }
    // Make it a piece.
    Piece& piece = new_piece();
    piece.first = window_first_ + at;
    piece.count = inside + 1 - at;
    piece.rank = rank_;
    piece.shared = before;
    piece.before = last_key_;
    last_key_ = window_[inside].key;
    // The rank matters only if more points with this key follow; then the piece has no other key.
    last_rank_ = rank_ + piece.count - 1;
    at = inside + 1;
  }
}

/// Builds all pieces of the window, joins them, and removes their points.
void OctreeBuilder::build(bool last) {
  cut(last);
  const auto is_last = [&](std::size_t i) { return last && i + 1 == piece_count_; };
  executor_.for_each(piece_count_, [&](std::size_t i, unsigned thread) {
    Piece& piece = pieces_[i];
    piece.groups.clear();
    piece.kept.clear();
    const bool at_edge = edges_ && (piece.first == 0 || is_last(i));
    piece.top = builders_[thread].build(points_of(piece), piece.first, piece.rank, piece.groups,
                                        at_edge ? &piece.kept : nullptr);
  });
  std::size_t done = 0;
  for (std::size_t i = 0; i < piece_count_; ++i) {
    Piece& piece = pieces_[i];
    join(piece);
    done += piece.count;
    if (!edges_) continue;
    const EdgeRecorder::Built built{piece.top, piece.kept, places_, points_of(piece)};
    if (piece.first == 0) edges_->begin(built);
    if (is_last(i)) edges_->end(built);
  }
  window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(done));
  window_first_ += done;
}

/// Joins a piece to the tree: closes the cells that end before it, then emits its groups.
void OctreeBuilder::join(Piece& piece) {
  // Close the cells that end before the piece, and put the node closed last into the cell that goes
  // on.
  if (piece.first > 0) {
    while (!path_.empty() && path_.back().level > piece.shared) {
      path_.back().children.push_back(current_);
      current_ = close(piece.first);
    }
    if (path_.empty() || path_.back().level < piece.shared) {
      path_.push_back({.cell = cell_of(piece.before, std::min(piece.shared, kLatticeBits)),
                       .level = piece.shared});
    }
    path_.back().children.push_back(current_);
  }
  // Emit the groups of the piece, with references in place of their numbers.
  places_.clear();
  const auto placed = [this](const ChildRef& ref) {
    return ref.interior ? places_[ref.page] : ref;
  };
  for (const SubtreeGroups::Group& at : piece.groups.groups) {
    const std::span<std::byte> group = std::span(piece.groups.bytes).subspan(at.begin, at.size);
    const GroupView view(group.data());
    for (int i = 0; i < view.size(); ++i) {
      if (const ChildRef ref = view.child(i); ref.interior) set_reference(group, i, placed(ref));
    }
    places_.push_back(emit(group, at.end));
  }
  current_ = piece.top;
  current_.ref = placed(current_.ref);
  result_.points = piece.first + piece.count;
}

/// Counts a group and hands it to the sink.
ChildRef OctreeBuilder::emit(std::span<std::byte> group, std::uint64_t end) {
  const GroupView view(group.data());
  result_.nodes += static_cast<unsigned>(view.size());
  ++result_.groups;
  result_.levels = std::max(result_.levels, view.level() + 1);
  return sink_.add(view, end);
}

/// Closes the innermost open cell, and returns the node that stands for it.
NodeChild OctreeBuilder::close(std::uint64_t end) {
  const NodeGroup group = std::move(path_.back());
  path_.pop_back();
  encoded_.clear();
  append_group(group, encoded_);
  const ChildRef placed = emit(encoded_, end);
  if (edges_) edges_->close(group, placed);
  return {placed, summarise_children(group.children)};
}

void OctreeBuilder::save(StateWriter& state) const {
  save_points(window_, state);
  for (const std::uint64_t number :
       {window_first_, last_key_.high, last_key_.low, last_rank_, result_.points, result_.nodes,
        result_.groups, static_cast<std::uint64_t>(result_.levels)}) {
    state.put(number);
  }
  save_child(current_, state);
  state.put(std::uint64_t{path_.size()});
  for (const NodeGroup& cell : path_) {
    state.put(cell.cell.high);
    state.put(cell.cell.low);
    state.put(std::uint64_t{static_cast<unsigned>(cell.level)});
    state.put(std::uint64_t{cell.children.size()});
    for (const NodeChild& child : cell.children) save_child(child, state);
  }
}

void OctreeBuilder::load(StateReader& state, const KnowsPage& knows) {
  // Load the points that wait, and the counts.
  window_ = load_points(state);
  for (std::uint64_t* number : {&window_first_, &last_key_.high, &last_key_.low, &last_rank_,
                                &result_.points, &result_.nodes, &result_.groups}) {
    *number = state.get<std::uint64_t>();
  }
  result_.levels = static_cast<int>(state.get_count(kMaxLevel + 1));
  state.require(
      result_.points == window_first_ && (window_.empty() || last_key_ <= window_.front().key),
      "the points in the tree's state are not in order");
  // Load the open cells from the root down.
  current_ = load_child(state, knows, window_first_);
  path_.resize(static_cast<std::size_t>(state.get_count(kMaxLevel + 1)));
  int above = -1;
  for (NodeGroup& cell : path_) {
    cell.cell = {state.get<std::uint64_t>(), state.get<std::uint64_t>()};
    cell.level = static_cast<int>(state.get_count(kMaxLevel));
    state.require(cell.level > above, "the open cells in the tree's state are not nested");
    above = cell.level;
    cell.children.resize(static_cast<std::size_t>(state.get_count(kMaxChildren - 1)));
    for (NodeChild& child : cell.children) child = load_child(state, knows, window_first_);
  }
}

OctreeBuilder::Result OctreeBuilder::finish() {
  build(true);
  if (result_.points == 0) return result_;
  while (!path_.empty()) {
    path_.back().children.push_back(current_);
    current_ = close(result_.points);
  }
  if (!current_.ref.interior) {  // all points in one leaf: a root group with one child
    path_.push_back({.level = 0, .children = {current_}});
    current_ = close(result_.points);
  }
  result_.root = current_.ref;
  result_.total = current_.node;
  return result_;
}

}  // namespace ptc
