#include "engine/scan/signed_graph.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <utility>

#include "engine/base/numbers.h"

namespace ptc {

void SignedGroups::reset(std::size_t nodes) {
  parent_.resize(nodes);
  flip_.assign(nodes, 0);
  for (std::size_t i = 0; i < nodes; ++i) parent_[i] = static_cast<std::uint32_t>(i);
}

SignedGroups::Group SignedGroups::find(std::uint32_t node) noexcept {
  // Find the root, then let all nodes on the way point to it.
  std::uint32_t root = node;
  std::uint8_t flips = 0;
  for (; parent_[root] != root; root = parent_[root]) flips ^= flip_[root];
  const bool flipped = flips != 0;
  while (node != root) {
    const std::uint32_t next = parent_[node];
    const auto above = static_cast<std::uint8_t>(flips ^ flip_[node]);
    flip_[node] = flips;
    parent_[node] = root;
    flips = above;
    node = next;
  }
  return {root, flipped};
}

void SignedGroups::join(std::uint32_t a, std::uint32_t b, bool opposite) noexcept {
  const Group ga = find(a), gb = find(b);
  if (ga.root == gb.root) return;
  parent_[gb.root] = ga.root;
  flip_[gb.root] = (ga.flipped != gb.flipped) != opposite;
}

SignedGraph::SignedGraph(std::size_t nodes)
    : groups_(nodes), beside_(nodes), slots_(std::bit_ceil(16 * nodes + 64)) {}

bool SignedGraph::Entry::operator<(const Entry& other) const noexcept {
  if (strength != other.strength) return strength < other.strength;
  return a != other.a ? a > other.a : b > other.b;
}

void SignedGraph::add(std::uint32_t a, std::uint32_t b, std::int64_t vote) {
  const Group ga = find(a), gb = find(b);
  if (ga.root == gb.root || vote == 0) return;
  slot(ga.root, gb.root).vote += ga.flipped != gb.flipped ? -vote : vote;
}

SignedGraph::Slot& SignedGraph::slot(std::uint32_t a, std::uint32_t b) {
  const std::uint64_t pair = std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
  const std::size_t mask = slots_.size() - 1;
  std::size_t at = static_cast<std::size_t>(splitmix64(pair)) & mask;
  while (slots_[at].pair != 0 && slots_[at].pair != pair) at = (at + 1) & mask;
  if (slots_[at].pair == pair) return slots_[at];
  if (2 * (used_ + 1) > slots_.size()) {
    grow();
    return slot(a, b);
  }
  ++used_;
  slots_[at].pair = pair;
  beside_[a].push_back(b);
  beside_[b].push_back(a);
  return slots_[at];
}

void SignedGraph::grow() {
  std::vector<Slot> old = std::exchange(slots_, std::vector<Slot>(2 * slots_.size()));
  const std::size_t mask = slots_.size() - 1;
  for (const Slot& s : old) {
    if (s.pair == 0) continue;
    std::size_t at = static_cast<std::size_t>(splitmix64(s.pair)) & mask;
    while (slots_[at].pair != 0) at = (at + 1) & mask;
    slots_[at] = s;
  }
}

void SignedGraph::contract(std::int64_t least) {
  // Queue all edges; whatever changes later is queued again, and old entries are passed over.
  queue_ = {};
  for (const Edge& edge : edges()) {
    if (std::abs(edge.vote) >= least) queue_.push({std::abs(edge.vote), edge.a, edge.b});
  }
  while (!queue_.empty()) {
    const Entry top = queue_.top();
    queue_.pop();
    if (top.strength < least) break;
    if (!groups_.is_root(top.a) || !groups_.is_root(top.b)) continue;
    const std::int64_t vote = slot(top.a, top.b).vote;
    if (std::abs(vote) == top.strength) join(top.a, top.b, vote);
  }
}

void SignedGraph::join(std::uint32_t a, std::uint32_t b, std::int64_t vote) {
  // Keep the group with more neighbours.
  if (beside_[a].size() < beside_[b].size()) std::swap(a, b);
  slot(a, b).vote = 0;
  groups_.join(a, b, vote < 0);
  // Hand its edges over.
  for (const std::uint32_t c : std::exchange(beside_[b], {})) {
    if (c == a || !groups_.is_root(c)) continue;
    const std::int64_t moved = std::exchange(slot(b, c).vote, 0);
    if (moved == 0) continue;
    Slot& kept = slot(a, c);
    kept.vote += vote < 0 ? -moved : moved;
    if (kept.vote != 0) queue_.push({std::abs(kept.vote), std::min(a, c), std::max(a, c)});
  }
}

std::vector<SignedGraph::Edge> SignedGraph::edges() const {
  std::vector<Edge> result;
  for (const Slot& s : slots_) {
    if (s.vote == 0) continue;
    result.push_back(
        {static_cast<std::uint32_t>(s.pair >> 32), static_cast<std::uint32_t>(s.pair), s.vote});
  }
  return result;
}

}  // namespace ptc
