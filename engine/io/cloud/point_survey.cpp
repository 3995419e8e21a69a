#include "engine/io/cloud/point_survey.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/io/cloud/packed_number.h"

namespace ptc {
namespace {

std::uint64_t count_at(const RowChannel& channel, const std::byte* row) noexcept {
  return static_cast<std::uint64_t>(load_integer(channel.channel.type, channel.at(row, 0)));
}

}  // namespace

void GridCheck::add(std::uint64_t index, std::uint64_t row, std::uint64_t column) noexcept {
  if (!holds_) return;
  if (row == 0) {
    holds_ = index == column;
  } else {
    const std::uint64_t before = index - column;  // points in the rows before this one
    const std::uint64_t width = before / row;
    holds_ = index > column && before % row == 0 && (width_ == 0 || width == width_);
    width_ = width;
  }
  ++count_;
  rows_ = std::max(rows_, row + 1);
  columns_ = std::max(columns_, column + 1);
}

std::optional<PointGrid> GridCheck::grid() const noexcept {
  if (!holds_ || rows_ < 2 || columns_ != width_) return std::nullopt;
  if (count_ % width_ != 0 || count_ / width_ != rows_) return std::nullopt;
  return PointGrid{.width = width_, .height = rows_};
}

PointSurvey::PointSurvey(OutputFormat format, std::span<const Channel> channels, const char* index)
    : row_bytes_(row_bytes(channels)) {
  const std::vector<std::string> names = measured_channels(format, channels);
  for (RowChannel& row : row_channels(channels, {})) {
    const std::string& name = row.channel.name;
    if (index != nullptr && name == index) index_ = row;
    if (std::ranges::find(names, name) == names.end()) continue;
    if (format == OutputFormat::las) {
      measured_.push_back({std::move(row), {}});
    } else {
      (name == "row" ? row_ : column_) = std::move(row);
    }
  }
}

void PointSurvey::add(std::span<const std::byte> rows) noexcept {
  add_ranges(rows);
  if (row_ && column_) add_cells(rows);
}

void PointSurvey::add_ranges(std::span<const std::byte> rows) noexcept {
  for (auto& [row, range] : measured_) {
    const Channel& channel = row.channel;
    for (std::size_t at = 0; at < rows.size(); at += row_bytes_) {
      const std::optional<double> value = meaning_of(channel, row.at(rows.data() + at, 0));
      if (!value || !std::isfinite(*value)) continue;
      range.low = std::min(range.low, *value);
      range.high = std::max(range.high, *value);
      range.whole = range.whole && *value == std::trunc(*value);
    }
  }
}

void PointSurvey::add_cells(std::span<const std::byte> rows) noexcept {
  for (std::size_t at = 0; at < rows.size(); at += row_bytes_) {
    const std::byte* const row = rows.data() + at;
    cells_.add(index_ ? count_at(*index_, row) : points_, count_at(*row_, row),
               count_at(*column_, row));
    ++points_;
  }
}

void PointSurvey::finish(PointWriteInfo& info) const {
  for (const Measured& measured : measured_)
    info.ranges[measured.channel.channel.name] = measured.range;
  info.grid = cells_.grid();
}

}  // namespace ptc
