// A page is decoded into columns once, and a run is some rows of them:
//
//   columns_   | run | run | run | ru            rows begin_ to end_ are taken, and are added up
//   gathered_                     | run |        when the next page comes
//
// A run that crosses the boundary of pages is gathered from them. Within a page keys ascend,
// because reading it checks that, so only the keys at both ends of a piece are needed.
#include "engine/verify/point_runs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "engine/store/clauses.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kOrder[] = "spec/points.md#point-order";
constexpr char kTotals[] = "spec/container.md#superblock-totals";

constexpr double kRelative = 1e-6;  // what another order of summation may change in a total

}  // namespace

void TreeReport::superblock(const char* clause, const std::string& text) const {
  findings_.add({.cause = Cause::writer,
                 .level = 3,
                 .offset = container_.superblock().file_bytes - 2 * kBlockBytes,
                 .rule = clause,
                 .text = text});
}

void TreeReport::page(std::uint32_t page, std::uint64_t from_header, const char* clause,
                      const std::string& text) const {
  const std::uint32_t part = container_.page_range(page).part, number = container_.own_number(page);
  findings_.add({.cause = Cause::writer,
                 .level = 3,
                 .offset = container_.entry(page).offset + from_header,
                 .page = number,
                 .file = part == 0 ? "" : container_.file(part).path().string(),
                 .rule = clause,
                 .text = fmt::format("page {}: {}", number, text)});
}

PointRuns::PointRuns(const ContainerReader& container, const std::vector<bool>& damaged,
                     CheckedPages& checked, const TreeReport& report)
    : container_(container),
      damaged_(damaged),
      checked_(checked),
      report_(report),
      per_page_(points_per_page(container.header())),
      unit_(container.header().frame.unit()),
      payload_(container.page_payload_limit()) {}

std::uint64_t PointRuns::bytes(const Superblock& superblock) noexcept {
  constexpr std::uint64_t kColumnBytes = PointColumns::kColumns * sizeof(double);
  const std::uint64_t page = std::uint64_t{1} << superblock.header.page_shift;
  const std::uint64_t run = superblock.leaf_points;
  return 2 * page + kColumnBytes * (points_per_page(superblock.header) + PointColumns::kMaxLanes) +
         (sizeof(PointRecord) + kColumnBytes) * (run + PointColumns::kMaxLanes);
}

std::optional<PointRun> PointRuns::take(std::uint64_t first, std::size_t count) {
  // Give up before anything is taken when a page is damaged.
  const std::uint64_t end = first + count;
  for (std::uint64_t rank = first / per_page_; rank * per_page_ < end; ++rank) {
    if (damaged_[container_.point_pages()[rank]]) return std::nullopt;
  }
  // Take the rows of the page, or gather those of several.
  pieces_.clear();
  const std::size_t row = first % per_page_;
  if (row + count <= per_page_) {
    take_piece(first, row, row + count);
    return PointRun{columns_, row, row + count, pieces_};
  }
  gathered_.clear();
  for (std::uint64_t at = first; at < end;) {
    const std::size_t begin = at % per_page_;
    const std::size_t last = std::min(per_page_, begin + (end - at));
    take_piece(at, begin, last);
    const PointPage points(payload_.data(), count_, container_.header().point_bytes);
    for (std::size_t i = begin; i < last; ++i)
      gathered_.push_back(points[static_cast<std::uint32_t>(i)]);
    at += last - begin;
  }
  gathered_columns_.assign(gathered_, unit_);
  return PointRun{gathered_columns_, 0, count, pieces_};
}

/// Takes the rows from `begin` up to `end` of the page of point `first`, and checks their order.
void PointRuns::take_piece(std::uint64_t first, std::size_t begin, std::size_t end) {
  load(container_.point_pages()[first / per_page_]);
  const PointPage points(payload_.data(), count_, container_.header().point_bytes);
  const auto key_at = [&](std::size_t row) {
    return encode_morton(points.position(static_cast<std::uint32_t>(row)));
  };
  pieces_.push_back({key_at(begin), key_at(end - 1)});
  const auto& [low, high] = pieces_.back();
  if (low < totals_.last) {
    report_.page(page_, kPageHeaderBytes, kOrder,
                 fmt::format("the key of point {} is less than that of the point before", first));
  }
  if (totals_.taken == 0) totals_.first = low;
  totals_.last = high;
  totals_.taken += end - begin;
  if (begin_ == end_) begin_ = begin;
  end_ = end;
}

/// Decodes a page, unless it is the one that was decoded last.
void PointRuns::load(std::uint32_t page) {
  if (page == page_) return;
  add_up();
  page_ = kNoPage;
  count_ = checked_.read(page, payload_, decoder_).record_count;
  columns_.assign(PointPage(payload_.data(), count_, container_.header().point_bytes), unit_);
  page_ = page;
}

/// Adds the rows from begin_ up to end_ to the totals.
void PointRuns::add_up() {
  const auto columns = [&](PointColumns::Column first) {
    std::array<const double*, 3> of{};
    for (std::size_t k = 0; k < 3; ++k)
      of[k] = columns_.column(static_cast<PointColumns::Column>(first + k));
    return of;
  };
  const double* const area = columns_.column(PointColumns::kDiscArea);
  const std::array position = columns(PointColumns::kX), radiance = columns(PointColumns::kRed);
  PointTotals sum;
  for (std::size_t i = begin_; i < end_; ++i) {
    sum.area += area[i];
    for (std::size_t k = 0; k < 3; ++k) {
      sum.flux[k] += area[i] * radiance[k][i];
      sum.low[k] = std::min(sum.low[k], position[k][i]);
      sum.high[k] = std::max(sum.high[k], position[k][i]);
    }
  }
  if (columns_.emits()) {
    const std::array emission = columns(PointColumns::kEmittedRed);
    for (std::size_t i = begin_; i < end_; ++i) {
      for (std::size_t k = 0; k < 3; ++k) sum.flux[k] += area[i] * emission[k][i];
    }
  }
  add(sum);
  begin_ = end_ = 0;
}

/// Adds sums and bounds.
void PointRuns::add(const PointTotals& sum) {
  totals_.area += sum.area;
  for (std::size_t k = 0; k < 3; ++k) {
    totals_.flux[k] += sum.flux[k];
    totals_.low[k] = std::min(totals_.low[k], sum.low[k]);
    totals_.high[k] = std::max(totals_.high[k], sum.high[k]);
  }
}

PointTotals PointRuns::finish() {
  add_up();
  return std::exchange(totals_, {});
}

bool PointRuns::append(const PointTotals& totals) {
  if (totals.taken == 0) return true;
  if (totals.first < totals_.last) return false;
  add_up();
  add(totals);
  totals_.taken += totals.taken;
  totals_.last = totals.last;
  return true;
}

void PointRuns::compare() {
  add_up();
  const Superblock& s = container_.superblock();
  if (totals_.taken != s.points)
    report_.superblock(clause::kSuperblockCounts,
                       fmt::format("the leaves hold {} of the {} points", totals_.taken, s.points));
  compare("area", s.area, totals_.area);
  for (std::size_t c = 0; c < 3; ++c) compare("flux", s.flux[c], totals_.flux[c]);
  std::array<double, 3> low{}, high{};
  if (totals_.taken > 0) {
    low = position_of(totals_.low);
    high = position_of(totals_.high);
  }
  if (s.bounds_low != low || s.bounds_high != high) {
    report_.superblock(kTotals, fmt::format("the bounds are not those of the points, which are "
                                            "{} {} {} to {} {} {}",
                                            low[0], low[1], low[2], high[0], high[1], high[2]));
  }
}

/// Returns a position in scene units, from whole lattice units.
std::array<double, 3> PointRuns::position_of(const std::array<double, 3>& lattice) const {
  LatticePoint point;
  std::ranges::transform(lattice, point.begin(),
                         [](double v) { return static_cast<std::uint64_t>(v); });
  return container_.header().frame.to_position(point);
}

/// Reports a total of the superblock that differs from that of the points by more than rounding.
void PointRuns::compare(const char* what, double said, double found) const {
  if (std::abs(said - found) <= kRelative * std::max(std::abs(said), std::abs(found))) return;
  report_.superblock(kTotals, fmt::format("the superblock records {} {}, but the points give {}",
                                          what, said, found));
}

}  // namespace ptc
