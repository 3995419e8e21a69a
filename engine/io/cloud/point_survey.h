// Measures what a writer must know of the values of channels before its file begins.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"

namespace ptc {

/// Finds the ranges of measured_channels().
class PointSurvey {
 public:
  /// @param channels  of the rows that add() gets
  PointSurvey(OutputFormat format, std::span<const Channel> channels);
  /// Says whether there is nothing to measure.
  [[nodiscard]] bool empty() const noexcept { return measured_.empty(); }
  /// Measures whole rows.
  void add(std::span<const std::byte> rows) noexcept;
  /// Sets what was measured.
  void finish(PointWriteInfo& info) const;

 private:
  struct Measured {
    RowChannel channel;
    ValueRange range;
  };

  std::vector<Measured> measured_;
  std::size_t row_bytes_;
};

}  // namespace ptc
