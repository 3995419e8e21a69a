#include "engine/scan/chunk_fit.h"

#include <algorithm>
#include <cmath>

namespace ptc {
namespace {

constexpr std::size_t kMany = 48;   // neighbours where few do not do
constexpr std::size_t kTried = 16;  // of so many blocks one tells whether few will do
constexpr float kNoisy = 0.12F;     // noise in units of the spacing, from which many are taken
constexpr float kLine = 0.25F;  // width in units of the length, below which neighbours are a line

/// Says whether a fit is to be repeated with more neighbours.
/// @param noise  RMS distance of its neighbours from its surface
bool wants_more(const PlaceFit& fit, float noise, float width) noexcept {
  return fit.count == kFewNeighbours && (noise > kNoisy * fit.spread || width < kLine);
}

}  // namespace

ChunkFitter::ChunkFitter(const ScanSpool& spool, std::size_t slots)
    : spool_(spool),
      search_(spool, slots),
      batch_(std::make_unique<Batch>()),
      lanes_(std::make_unique<FitLanes>()) {}

std::uint64_t ChunkFitter::bytes(std::size_t page_places, std::size_t slots) noexcept {
  return NeighbourSearch::bytes(page_places, slots) + sizeof(Batch) + sizeof(FitLanes);
}

void ChunkFitter::fit(std::uint64_t number, ScanChunk& chunk) {
  // Read the places and split them into blocks.
  chunk.first = number * kChunkPlaces;
  const auto count = static_cast<std::size_t>(
      std::min<std::uint64_t>(kChunkPlaces, spool_.places() - chunk.first));
  chunk.places.resize(count);
  spool_.read_places(chunk.first, chunk.places);
  chunk.positions.resize(count);
  for (std::size_t i = 0; i < count; ++i) chunk.positions[i] = position_of(chunk.places[i].key);
  split_blocks(chunk.places, chunk.blocks);
  chunk.fits.assign(count, {});
  chunk.links.resize(count);
  chunk.outer.clear();
  // Try few neighbours in a part of the blocks.
  std::vector<std::uint8_t> chosen(count, 0);
  const auto choose = [&](bool tried) {
    for (std::size_t b = 0; b < chunk.blocks.size(); ++b) {
      const PlaceBlock& block = chunk.blocks[b];
      std::fill(chosen.begin() + block.begin, chosen.begin() + block.end,
                (b % kTried == 0) == tried ? 1 : 0);
    }
  };
  choose(true);
  fit_all(chunk, chosen, kFewNeighbours, reach_few_);
  const auto tried = std::ranges::count(chosen, 1);
  const auto scattered = std::ranges::count(chunk.fits, true, &PlaceFit::scattered);
  if (2 * scattered > tried) {
    // The cloud is noisy, where planes through few points are found by chance. All get more.
    std::ranges::fill(chosen, 1);
  } else {
    // Fit the others, and repeat those that want more.
    choose(false);
    fit_all(chunk, chosen, kFewNeighbours, reach_few_);
    for (std::size_t i = 0; i < count; ++i) chosen[i] = chunk.fits[i].wants_more ? 1 : 0;
  }
  std::erase_if(chunk.outer, [&](const OuterLink& link) { return chosen[link.from] != 0; });
  fit_all(chunk, chosen, kMany, reach_many_);
}

/// Fits the chosen places of a chunk to a number of neighbours.
void ChunkFitter::fit_all(ScanChunk& chunk, std::span<const std::uint8_t> chosen,
                          std::size_t neighbours, double& reach) {
  if (std::ranges::find(chosen, 1) == chosen.end()) return;
  std::vector<std::uint32_t> queries;
  for (const PlaceBlock& block : chunk.blocks) {
    queries.clear();
    for (std::uint32_t i = block.begin; i < block.end; ++i) {
      if (chosen[i] != 0) queries.push_back(i - block.begin);
    }
    if (queries.empty()) continue;
    const auto positions =
        std::span(chunk.positions).subspan(block.begin, std::size_t{block.end} - block.begin);
    search_.search(positions, queries, neighbours + 1, reach,
                   [&](std::uint32_t query, const Neighbours& found) {
                     add(chunk, block.begin + query, found);
                   });
  }
  flush(chunk);
}

/// Adds the neighbourhood of a place to the batch, and links the place to some of it.
void ChunkFitter::add(ScanChunk& chunk, std::uint32_t place, const Neighbours& neighbours) {
  Batch& batch = *batch_;
  const std::size_t lane = batch.lanes++;
  const std::uint64_t own = chunk.first + place;
  const Candidates& from = neighbours.candidates;
  const float reach = std::sqrt(neighbours.farthest);
  const float scale = reach > 0 ? 1 / reach : 0;
  const std::size_t total = std::max<std::size_t>(neighbours.found.size(), 2) - 1;
  std::array<std::uint32_t, kLinks>& links = chunk.links[place];
  links.fill(kNoLink);
  const float *xs = from.x.data(), *ys = from.y.data(), *zs = from.z.data();
  const float* squared = from.squared.data();
  const auto [px, py, pz] = neighbours.position;
  FitBatch& rows = batch.rows;
  std::size_t row = 0, link = 0, due = 0;
  for (const std::uint32_t i : neighbours.found) {
    if (squared[i] == 0 && neighbours.place(i) == own) continue;
    const float x = xs[i] - px, y = ys[i] - py, z = zs[i] - pz;
    rows.x[row][lane] = x * scale;
    rows.y[row][lane] = y * scale;
    rows.z[row][lane] = z * scale;
    if (++row == kMostNeighbours) break;
    // Every second neighbour or so, in the order of the curve, becomes a link.
    due += kLinks;
    if (due < total) continue;
    due = std::min(due - total, total - 1);
    const std::uint64_t other = neighbours.place(i);
    if (other < chunk.first) {
      chunk.outer.push_back({place, other, {x, y, z}});
    } else if (other - chunk.first < chunk.places.size() && link < kLinks) {
      links[link++] = static_cast<std::uint32_t>(other - chunk.first);
    }
  }
  batch.rows.count[lane] = static_cast<float>(row);
  batch.rows.rows = std::max(batch.rows.rows, row);
  batch.places[lane] = place;
  batch.reach[lane] = reach;
  if (batch.lanes == kFitLanes) flush(chunk);
}

/// Fits the batch and stores what comes out.
void ChunkFitter::flush(ScanChunk& chunk) {
  Batch& batch = *batch_;
  if (batch.lanes == 0) return;
  for (std::size_t lane = batch.lanes; lane < kFitLanes; ++lane) batch.rows.count[lane] = 0;
  fit_surfaces(batch.rows, *lanes_);
  const FitLanes& from = *lanes_;
  for (std::size_t lane = 0; lane < batch.lanes; ++lane) {
    PlaceFit& fit = chunk.fits[batch.places[lane]];
    const float reach = batch.reach[lane];
    for (std::size_t k = 0; k < 3; ++k) {
      fit.normal[k] = from.normal[k][lane];
      fit.broad[k] = from.broad[k][lane];
      fit.to_surface[k] = reach * from.offset[lane] * fit.normal[k];
    }
    for (std::size_t k = 0; k < 6; ++k) fit.directions[k] = from.directions[k][lane];
    fit.reach = reach;
    fit.noise = reach * from.noise[lane];
    fit.offset = reach * std::abs(from.offset[lane]);
    fit.nearest = reach * from.nearest[lane];
    fit.spread = reach * from.spread[lane];
    fit.flatness = from.flatness[lane];
    fit.aside = from.aside[lane];
    fit.gap = reach * from.gap[lane];
    fit.count = static_cast<std::uint8_t>(batch.rows.count[lane]);
    fit.wants_more = wants_more(fit, fit.noise, from.width[lane]);
    fit.scattered = wants_more(fit, reach * from.scatter[lane], from.width[lane]);
  }
  batch.lanes = 0;
  batch.rows.rows = 0;
}

}  // namespace ptc
