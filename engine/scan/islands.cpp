#include "engine/scan/islands.h"

#include <algorithm>
#include <cmath>

namespace ptc {
namespace {

/// Returns the vote of the sky on a piece. Where its places see less than one direction
/// more in the mean, that may be a beam through a gap.
/// @param sky  sum of SkyView::more_in_front()
std::int64_t vote_of_sky(std::int64_t sky, std::uint64_t places) noexcept {
  return std::abs(sky) < static_cast<std::int64_t>(places) ? 0
                                                           : sky * kFullVote / SkyView::kDirections;
}

/// Says whether an island is to be flipped: a closed one turns outwards, an open sheet upwards.
bool points_inwards(const PieceSums& island, const std::array<float, 3>& up) noexcept {
  constexpr double kOpen = 0.4;  // mean of the normals from which on an island is a sheet
  if (!(island.area > 0)) return false;
  double upwards = 0, outwards = island.flux, length = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double mean = island.normal[k] / island.area;
    length += mean * mean;
    upwards += mean * up[k];
    outwards -= island.normal[k] * island.position[k] / island.area;
  }
  const bool sheet = std::sqrt(length) > kOpen && std::abs(upwards) > kOpen / 2;
  return sheet ? upwards < 0 : outwards < 0;
}

}  // namespace

void Islands::add_chunk(const ChunkPieces& pieces) {
  first_.push_back(static_cast<std::uint32_t>(sums_.size()));
  const std::uint64_t chunk = first_.size() - 1;
  sums_[0].add(pieces.sums[0], false);
  sums_.insert(sums_.end(), pieces.sums.begin() + 1, pieces.sums.end());
  std::vector<SignedGraph::Edge> votes;
  for (const SignedGraph::Edge& edge : pieces.votes) {
    votes.push_back({piece(chunk, static_cast<std::uint16_t>(edge.a)),
                     piece(chunk, static_cast<std::uint16_t>(edge.b)), edge.vote});
  }
  add_votes(votes);
}

void Islands::add_votes(std::vector<SignedGraph::Edge>& votes) {
  for (SignedGraph::Edge& edge : votes) {
    if (edge.a > edge.b) std::swap(edge.a, edge.b);
  }
  std::ranges::sort(votes, [](const SignedGraph::Edge& x, const SignedGraph::Edge& y) {
    return x.a != y.a ? x.a < y.a : x.b < y.b;
  });
  const std::size_t first = votes_.size();
  for (const SignedGraph::Edge& edge : votes) {
    if (edge.a == edge.b) continue;
    const bool more =
        votes_.size() > first && votes_.back().a == edge.a && votes_.back().b == edge.b;
    if (more) {
      votes_.back().vote += edge.vote;
    } else {
      votes_.push_back(edge);
    }
  }
  votes.clear();
}

std::uint64_t Islands::bytes() const noexcept {
  constexpr std::uint64_t kGraph = 64;  // of a node: its group and the list of its neighbours
  constexpr std::uint64_t kEdge = 160;  // in the table, at most half full, the lists, the queue
  return sums_.size() * (3 * sizeof(PieceSums) + kGraph) +
         votes_.size() * (2 * sizeof(SignedGraph::Edge) + kEdge);
}

void Islands::solve(const std::array<float, 3>& up) {
  const auto count = static_cast<std::uint32_t>(sums_.size());
  SignedGraph graph(count);
  for (const SignedGraph::Edge& edge : votes_) graph.add(edge.a, edge.b, edge.vote);
  for (std::uint32_t i = 1; i < count; ++i) {
    if (const std::int64_t vote = vote_of_sky(sums_[i].sky, sums_[i].places); vote != 0)
      graph.add(0, i, vote);
  }
  graph.contract(1);
  // Add up the pieces of each island.
  std::vector<PieceSums> islands(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const SignedGraph::Group group = graph.find(i);
    islands[group.root].add(sums_[i], group.flipped);
  }
  // Turn them: the one of piece 0 so that this piece stays as it is.
  const SignedGraph::Group known = graph.find(0);
  flipped_.assign(count, 0);
  for (std::uint32_t i = 0; i < count; ++i) {
    const SignedGraph::Group group = graph.find(i);
    const bool turn =
        group.root == known.root ? known.flipped : points_inwards(islands[group.root], up);
    flipped_[i] = group.flipped != turn;
    islands_ += i == group.root && islands[i].places > 0 && i != known.root;
  }
  sums_ = {};
  votes_ = {};
}

}  // namespace ptc
