// Measures what a writer must know of the values of channels before its file begins.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"

namespace ptc {

/// Finds out whether points lie in a grid, row by row.
///
/// Point i of a grid of width w has row r and column c with i = r w + c. The first point behind row
/// 0 tells w, and all others must agree.
class GridCheck {
 public:
  /// Adds a point that lies in a cell.
  /// @param index  place of the point among those that will be written
  void add(std::uint64_t index, std::uint64_t row, std::uint64_t column) noexcept;
  /// Returns the grid of all points.
  [[nodiscard]] std::optional<PointGrid> grid() const noexcept;

 private:
  bool holds_ = true;
  std::uint64_t count_ = 0;
  std::uint64_t width_ = 0;  // 0 until a point behind row 0 tells it
  std::uint64_t rows_ = 0;
  std::uint64_t columns_ = 0;
};

/// Measures, over all rows, the channels that measured_channels() names for a format.
class PointSurvey {
 public:
  /// @param channels  of the rows that add() gets
  /// @param index     name of the channel that holds the place of each point in the file; without
  ///                  one, points are written in the order in which they are measured
  PointSurvey(OutputFormat format, std::span<const Channel> channels, const char* index = nullptr);
  /// Says whether there is nothing to measure.
  [[nodiscard]] bool empty() const noexcept { return measured_.empty() && !row_; }
  /// Measures whole rows.
  void add(std::span<const std::byte> rows) noexcept;
  /// Sets what was measured.
  void finish(PointWriteInfo& info) const;

 private:
  struct Measured {
    RowChannel channel;
    ValueRange range;
  };

  void add_ranges(std::span<const std::byte> rows) noexcept;
  void add_cells(std::span<const std::byte> rows) noexcept;

  std::size_t row_bytes_;
  std::vector<Measured> measured_;  // by range
  std::optional<RowChannel> row_;   // of a grid, as the next two
  std::optional<RowChannel> column_;
  std::optional<RowChannel> index_;
  std::uint64_t points_ = 0;  // of which the cells were measured
  GridCheck cells_;
};

}  // namespace ptc
