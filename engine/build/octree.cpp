#include "engine/build/octree.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace ptc {

OctreeBuilder::OctreeBuilder(GroupSink& sink, std::uint32_t leaf_points, double unit, const Executor& executor)
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

/// Level of the smallest cell that holds the window's point `at`, whose rank is rank_, and a later one.
int OctreeBuilder::common(std::size_t at, std::size_t other) const {
  const int level = common_level(window_[at].key, window_[other].key);
  return level < kLatticeBits ? level : level + common_rank_level(rank_, rank_ + (other - at));
}

/// The same of the point `at` and the one before.
int OctreeBuilder::level_before(std::size_t at) const {
  const int level = common_level(last_key_, window_[at].key);
  return level < kLatticeBits ? level : level + common_rank_level(rank_ - 1, rank_);
}

OctreeBuilder::Piece& OctreeBuilder::new_piece() {
  if (piece_count_ == pieces_.size()) pieces_.emplace_back();
  return pieces_[piece_count_++];
}

/// Cuts the window's front into pieces: from each point on the largest cell that has no more than piece_points_
/// points and does not hold the point before. As a cell around it has more points than a leaf, it is a node.
void OctreeBuilder::cut(bool last) {
  piece_count_ = 0;
  for (std::size_t at = 0; at < window_.size();) {
    const std::size_t reach = window_.size() - at;
    if (reach <= piece_points_ && !last) break;
    const bool begins = window_first_ + at == 0;
    rank_ = begins || window_[at].key != last_key_ ? 0 : last_rank_ + 1;
    const int before = begins ? -1 : level_before(at);
    const int level = 1 + (reach > piece_points_ ? std::max(before, common(at, at + piece_points_)) : before);
    std::size_t inside = at;
    for (std::size_t outside = at + std::min(reach, piece_points_); outside - inside > 1;) {
      const std::size_t middle = inside + (outside - inside) / 2;
      (common(at, middle) >= level ? inside : outside) = middle;
    }
    Piece& piece = new_piece();
    piece.first = window_first_ + at;
    piece.count = inside + 1 - at;
    piece.rank = rank_;
    piece.shared = before;
    piece.before = last_key_;
    last_key_ = window_[inside].key;
    last_rank_ = rank_ + piece.count - 1;  // of use only where this key goes on, and then the piece has no other
    at = inside + 1;
  }
}

void OctreeBuilder::build(bool last) {
  cut(last);
  executor_.for_each(piece_count_, [this](std::size_t i, unsigned thread) {
    Piece& piece = pieces_[i];
    piece.groups.clear();
    const auto points = std::span(window_).subspan(static_cast<std::size_t>(piece.first - window_first_), piece.count);
    piece.top = builders_[thread].build(points, piece.first, piece.rank, piece.groups);
  });
  std::size_t done = 0;
  for (Piece& piece : std::span(pieces_).first(piece_count_)) {
    join(piece);
    done += piece.count;
  }
  window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(done));
  window_first_ += done;
}

/// Hands a piece's groups on, when the cells that end before it are closed.
void OctreeBuilder::join(Piece& piece) {
  if (piece.first > 0) {
    while (!path_.empty() && path_.back().level > piece.shared) {
      path_.back().children.push_back(current_);
      current_ = close(piece.first);
    }
    if (path_.empty() || path_.back().level < piece.shared) {
      path_.push_back({.cell = cell_of(piece.before, std::min(piece.shared, kLatticeBits)), .level = piece.shared});
    }
    path_.back().children.push_back(current_);
  }
  places_.clear();
  const auto placed = [this](const ChildRef& ref) { return ref.interior ? places_[ref.page] : ref; };
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

ChildRef OctreeBuilder::emit(std::span<std::byte> group, std::uint64_t end) {
  const GroupView view(group.data());
  result_.nodes += static_cast<unsigned>(view.size());
  ++result_.groups;
  result_.levels = std::max(result_.levels, view.level() + 1);
  return sink_.add(view, end);
}

/// Closes the innermost open cell.
NodeChild OctreeBuilder::close(std::uint64_t end) {
  const NodeGroup group = std::move(path_.back());
  path_.pop_back();
  encoded_.clear();
  append_group(group, encoded_);
  return {emit(encoded_, end), summarise_children(group.children)};
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
