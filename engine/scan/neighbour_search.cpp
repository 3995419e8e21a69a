#include "engine/scan/neighbour_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ptc {
namespace {

constexpr std::size_t kMostCandidates = 2048;
constexpr int kAttempts = 12;       // boxes that are tried before pages are searched one by one
constexpr double kSlack = 1e-5;     // relative, of distances in float
constexpr double kHeadroom = 1.03;  // of the reach for the next block
constexpr std::size_t kMostWanted = 256;

/// Splits the places [begin, end), which share a cell, and appends the blocks.
/// @param shared  by place: the level of the smallest cell that holds it and the place before
void split_cell(std::span<const Place> places, std::span<const std::uint8_t> shared,
                std::uint32_t begin, std::uint32_t end, std::vector<PlaceBlock>& blocks) {
  if (end - begin <= kBlockPlaces) {
    blocks.push_back({begin, end});
    return;
  }
  const auto level =
      static_cast<std::uint8_t>(common_level(places[begin].key, places[end - 1].key));
  std::uint32_t open = begin;  // places from here on are in no block yet
  std::uint32_t child = begin;
  while (child < end) {
    // Find the end of the child cell.
    std::uint32_t next = child + 1;
    while (next < end && shared[next] != level) ++next;
    // Join it with the cells before it, as far as a block holds them.
    if (next - open > kBlockPlaces) {
      if (open < child) blocks.push_back({open, child});
      open = child;
      if (next - child > kBlockPlaces) {
        split_cell(places, shared, child, next, blocks);
        open = next;
      }
    }
    child = next;
  }
  if (open < end) blocks.push_back({open, end});
}

}  // namespace

void split_blocks(std::span<const Place> places, std::vector<PlaceBlock>& blocks) {
  blocks.clear();
  if (places.empty()) return;
  std::vector<std::uint8_t> shared(places.size());
  for (std::size_t i = 1; i < places.size(); ++i) {
    shared[i] = static_cast<std::uint8_t>(common_level(places[i - 1].key, places[i].key));
  }
  split_cell(places, shared, 0, static_cast<std::uint32_t>(places.size()), blocks);
}

NeighbourSearch::NeighbourSearch(const ScanSpool& spool, std::size_t slots)
    : spool_(spool),
      pages_(spool, slots),
      candidates_(kMostCandidates),
      far_candidates_(kMostWanted),
      found_(kMostCandidates + Candidates::kSlack) {}

std::uint64_t NeighbourSearch::bytes(std::size_t page_places, std::size_t slots) noexcept {
  return PlacePages::bytes(page_places, slots) + 32 * kMostCandidates + 40 * kMostWanted;
}

std::array<float, 3> NeighbourSearch::relative(const Task& task, const LatticePosition& p) const {
  return {static_cast<float>(p[0] - task.centre[0]), static_cast<float>(p[1] - task.centre[1]),
          static_cast<float>(p[2] - task.centre[2])};
}

void NeighbourSearch::search(std::span<const LatticePosition> block,
                             std::span<const std::uint32_t> queries, std::size_t wanted,
                             double& reach, const Take& take) {
  Task task{.block = block, .wanted = wanted};
  for (const LatticePosition& p : block) task.box.add(p);
  task.centre = task.box.centre();
  for (std::size_t k = 0; k < 3; ++k) task.half[k] = (task.box.high[k] - task.box.low[k]) / 2;
  pending_.assign(queries.begin(), queries.end());
  // Gather and choose, in boxes between one that was too small and one that held too many.
  double too_small = 0, too_large = std::numeric_limits<double>::infinity();
  double now = reach > 0 ? reach : std::max({task.half[0], task.half[1], task.half[2], 1.0});
  double needed = 0;
  for (int attempt = 0; attempt < kAttempts && !pending_.empty(); ++attempt) {
    const LatticeBox grown = task.box.grown(now);
    const bool everything = grown.contains(spool_.index().bounds());
    double next = 2 * now;
    if (!gather(task, grown, now)) {
      too_large = now;
      next = too_small > 0 ? (too_small + now) / 2 : now / 2;
    } else {
      too_small = now;
      if (everything || candidates_.count >= wanted)
        next = take_complete(task, now, everything, needed, take);
    }
    if (next >= too_large) next = (too_small + too_large) / 2;
    if (too_large < 1.1 * too_small || next < 0.5) break;
    now = next;
  }
  for (const std::uint32_t query : pending_) search_far(task, query, take);
  if (needed > 0) reach = kHeadroom * needed;
}

/// Fills the candidates with all places in a box. @return false when they have no room for them
bool NeighbourSearch::gather(const Task& task, const LatticeBox& grown, double reach) {
  spool_.index().overlapping(grown, overlapping_);
  if (overlapping_.size() > pages_.slots()) return false;
  pages_.load(overlapping_, slots_);
  const CentredBox box{.centre = task.centre,
                       .half = {task.half[0] + reach, task.half[1] + reach, task.half[2] + reach}};
  candidates_.count = 0;
  for (const std::uint32_t slot : slots_) {
    if (!gather_page(pages_.view(slot), box, pages_.first_id(slot), candidates_)) return false;
  }
  return true;
}

/// Hands out the pending queries whose neighbours all lie in the box.
/// @param everything  the box holds all places
/// @param needed      is raised to the reach that these queries needed
/// @return the reach that the others need
double NeighbourSearch::take_complete(const Task& task, double reach, bool everything,
                                      double& needed, const Take& take) {
  double next = reach;
  float guess = static_cast<float>(reach * reach);
  const double rounding = kSlack * std::max({task.half[0], task.half[1], task.half[2]});
  std::size_t left = 0;
  for (const std::uint32_t query : pending_) {
    const std::array<float, 3> position = relative(task, task.block[query]);
    float farthest = 0;
    const std::size_t count =
        find_nearest(candidates_, position, task.wanted, guess, found_.data(), farthest);
    if (farthest > 0) guess = farthest;
    // The box holds everything up to the nearest of its faces.
    double inside = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
      inside = std::min(inside, task.half[k] - std::abs(static_cast<double>(position[k])));
    }
    const double own = std::sqrt(static_cast<double>(farthest)) * (1 + kSlack) + rounding - inside;
    if (own > reach && !everything) {
      pending_[left++] = query;
      next = std::max(next, own);
      continue;
    }
    needed = std::max(needed, own);
    take(query, {.candidates = candidates_,
                 .found = std::span(found_).first(count),
                 .position = position,
                 .farthest = farthest,
                 .pages = &pages_,
                 .far = nullptr});
  }
  pending_.resize(left);
  return std::max(1.02 * next, 1.05 * reach);
}

/// Collects the nearest places of a query, page after page, in no particular order.
std::vector<NeighbourSearch::Near> NeighbourSearch::collect_far(const Task& task,
                                                                std::uint32_t query) {
  const std::array<float, 3> position = relative(task, task.block[query]);
  const double rounding = kSlack * std::max({task.half[0], task.half[1], task.half[2]});
  std::vector<Near> near;  // a heap with the farthest on top
  NearestPages pages(spool_.index(), task.block[query]);
  while (const auto page = pages.next()) {
    if (near.size() == task.wanted && std::sqrt(page->squared) * (1 - kSlack) - rounding >
                                          std::sqrt(static_cast<double>(near.front().squared))) {
      break;
    }
    pages_.load(std::span(&page->page, 1), slots_);
    const PageView view = pages_.view(slots_[0]);
    for (std::uint32_t i = 0; i < view.groups * kGroupPlaces; ++i) {
      const std::array<float, 3> other =
          relative(task, {view.position[0][i], view.position[1][i], view.position[2][i]});
      const float x = other[0] - position[0], y = other[1] - position[1],
                  z = other[2] - position[2];
      const Near found{x * x + y * y + z * z, pages_.place(pages_.first_id(slots_[0]) + i), other};
      if (!std::isfinite(found.squared)) continue;
      if (near.size() == task.wanted) {
        if (!(found < near.front())) continue;
        std::pop_heap(near.begin(), near.end());
        near.pop_back();
      }
      near.push_back(found);
      std::push_heap(near.begin(), near.end());
    }
  }
  return near;
}

/// Searches pages by increasing distance, and hands out what is found as if there were no other
/// candidates.
void NeighbourSearch::search_far(const Task& task, std::uint32_t query, const Take& take) {
  std::vector<Near> near = collect_far(task, query);
  std::ranges::sort(near, {}, &Near::place);
  float farthest = 0;
  far_places_.clear();
  for (std::size_t i = 0; i < near.size(); ++i) {
    far_candidates_.x[i] = near[i].position[0];
    far_candidates_.y[i] = near[i].position[1];
    far_candidates_.z[i] = near[i].position[2];
    far_candidates_.squared[i] = near[i].squared;
    far_candidates_.id[i] = found_[i] = static_cast<std::uint32_t>(i);
    far_places_.push_back(near[i].place);
    farthest = std::max(farthest, near[i].squared);
  }
  far_candidates_.count = near.size();
  take(query, {.candidates = far_candidates_,
               .found = std::span(found_).first(near.size()),
               .position = relative(task, task.block[query]),
               .farthest = farthest,
               .pages = nullptr,
               .far = far_places_.data()});
}

}  // namespace ptc
