// Internal to the point readers: sources that convert packed records, one after another or from
// columns.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/stream.h"
#include "engine/io/cloud/point_layout.h"

namespace ptc {

/// A source of points whose records come one after another. A reader derives from it, sets the
/// layout in its constructor, and returns records.
class RecordSource : public PointSource {
 public:
  std::size_t next(std::span<Surfel> out) final;
  [[nodiscard]] std::span<const std::byte> attributes() const noexcept final {
    return std::span(rows_).first(used_);
  }
  [[nodiscard]] std::uint64_t left_out() const noexcept final { return left_out_; }
  /// Takes colours in fields of 16 bits as those of 8 bits.
  void take_bytes_as_colours() noexcept { layout_->take_bytes_as_colours(); }

 protected:
  /// Sets how records are converted, before the first call of next().
  void set_layout(PointLayout layout) { layout_ = std::move(layout); }
  [[nodiscard]] const PointLayout& layout() const noexcept { return *layout_; }
  /// Returns the next record, valid until the next call, or null at the end of the file.
  [[nodiscard]] virtual const std::byte* next_record() = 0;
  /// Refuses the file because of the record that next_record() returned last. @throws DataError
  [[noreturn]] virtual void fail_record(const std::string& rule) const = 0;
  /// Is called whenever next() has converted its last record.
  virtual void finish_block() {}

 private:
  std::optional<PointLayout> layout_;
  std::vector<std::byte> rows_;  // of the last block; longer than its rows
  std::size_t used_ = 0;         // bytes of rows_ that are rows of the last block
  std::uint64_t records_ = 0;    // that next_record() returned
  std::uint64_t left_out_ = 0;
};

/// A source of points whose file keeps each field of all points together. It reads a part of every
/// column and interleaves them into records.
class ColumnSource : public RecordSource {
 protected:
  /// A column of the file and its place in a record.
  struct Column {
    std::size_t bytes = 0;   ///< of a point
    std::size_t offset = 0;  ///< in a record
  };
  /// Sets the shape of the file, before the first call of next().
  void set_columns(std::vector<Column> columns, std::size_t record_bytes, std::uint64_t count);
  /// Fills `out` with the values of a column for the points from `first` on. Each column is read
  /// from front to back.
  virtual void read_column(std::size_t column, std::uint64_t first, std::span<std::byte> out) = 0;
  /// Sets the fields of a record that are in no column.
  virtual void complete(std::uint64_t /*index*/, std::byte* /*record*/) {}
  [[nodiscard]] const std::byte* next_record() final;
  /// Returns the index of the record that next_record() returned last.
  [[nodiscard]] std::uint64_t index() const noexcept { return first_ + at_ - 1; }

 private:
  void read_block();

  std::vector<Column> columns_;
  std::size_t record_bytes_ = 0;
  std::uint64_t count_ = 0;         // points of the file
  std::uint64_t first_ = 0;         // index of the first record of block_
  std::size_t in_block_ = 0;        // records of block_
  std::size_t at_ = 0;              // records of block_ that were returned
  std::vector<std::byte> block_;    // whole records
  std::vector<std::byte> scratch_;  // values of one column
};

}  // namespace ptc
