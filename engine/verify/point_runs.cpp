// Runs are cut from one decoded page after another; a run may cross the boundary of two pages.
// Every point that is taken is added to the totals that finish() compares with the superblock.
#include "engine/verify/point_runs.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr char kOrder[] = "spec/points.md#point-order";
constexpr char kCounts[] = "spec/container.md#superblock-counts";
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

std::optional<std::span<const PointRecord>> PointRuns::take(std::uint64_t first,
                                                            std::size_t count) {
  // Copy the points from their pages.
  block_.clear();
  const std::uint64_t per_page = points_per_page(container_.header());
  for (std::uint64_t at = first; at < first + count;) {
    const std::uint32_t page = container_.point_pages()[at / per_page];
    if (damaged_[page]) return std::nullopt;
    if (page != page_) {
      count_ = container_.read_page(page, payload_, decoder_).record_count;
      page_ = page;
    }
    const PointPage points(payload_.data(), count_, container_.header().point_bytes);
    for (auto i = static_cast<std::uint32_t>(at % per_page); i < count_ && at < first + count;
         ++i, ++at) {
      block_.push_back(points[i]);
    }
  }
  // Check their order, and add them to the totals.
  for (std::size_t i = 0; i < count; ++i) add(first + i, block_[i]);
  return block_;
}

void PointRuns::finish() const {
  const Superblock& s = container_.superblock();
  if (taken_ != s.points)
    report_.superblock(kCounts,
                       fmt::format("the leaves hold {} of the {} points", taken_, s.points));
  compare("area", s.area, area_);
  for (std::size_t c = 0; c < 3; ++c) compare("flux", s.flux[c], flux_[c]);
  if (s.bounds_low != low_ || s.bounds_high != high_) {
    report_.superblock(kTotals,
                       fmt::format("the bounds are not those of the points, which are {} {} {} to "
                                   "{} {} {}",
                                   low_[0], low_[1], low_[2], high_[0], high_[1], high_[2]));
  }
}

/// Checks the order of a point, and adds it to the totals.
void PointRuns::add(std::uint64_t number, const PointRecord& point) {
  if (point.key < last_) {
    report_.page(page_, kPageHeaderBytes, kOrder,
                 fmt::format("the key of point {} is less than that of the point before", number));
  }
  last_ = point.key;
  const std::array<double, 3> at = container_.header().frame.to_position(decode_morton(point.key));
  const double area = 2.0 * static_cast<double>(point.radius) * static_cast<double>(point.radius);
  area_ += area;
  for (std::size_t k = 0; k < 3; ++k) {
    low_[k] = taken_ == 0 ? at[k] : std::min(low_[k], at[k]);
    high_[k] = taken_ == 0 ? at[k] : std::max(high_[k], at[k]);
    flux_[k] += area * (static_cast<double>(decode_half(point.radiance[k])) +
                        static_cast<double>(decode_half(point.emission[k])));
  }
  ++taken_;
}

/// Reports a total of the superblock that differs from that of the points by more than rounding.
void PointRuns::compare(const char* what, double said, double found) const {
  if (std::abs(said - found) <= kRelative * std::max(std::abs(said), std::abs(found))) return;
  report_.superblock(kTotals, fmt::format("the superblock records {} {}, but the points give {}",
                                          what, said, found));
}

}  // namespace ptc
