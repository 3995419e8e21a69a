// The loop over records that all point readers share, and the way from columns to records.
#include "engine/io/cloud/record_source.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace ptc {

std::size_t RecordSource::next(std::span<Surfel> out) {
  used_ = 0;
  if (out.empty()) return 0;
  const std::size_t row_bytes = layout_->row_bytes();
  if (rows_.size() < out.size() * row_bytes) rows_.resize(out.size() * row_bytes);
  std::size_t count = 0;
  std::string rule;
  while (count < out.size()) {
    const std::byte* const record = next_record();
    if (record == nullptr) break;
    const auto outcome =
        layout_->convert(record, out[count], rows_.data() + count * row_bytes, rule);
    if (outcome == PointLayout::Outcome::refused) {
      fail_record("point " + std::to_string(records_) + ": " + rule);
    }
    if (outcome == PointLayout::Outcome::point) {
      ++count;
    } else {
      ++left_out_;
    }
    ++records_;
  }
  finish_block();
  used_ = count * row_bytes;
  return count;
}

void ColumnSource::set_columns(std::vector<Column> columns, std::size_t record_bytes,
                               std::uint64_t count) {
  columns_ = std::move(columns);
  record_bytes_ = record_bytes;
  count_ = count;
}

const std::byte* ColumnSource::next_record() {
  if (at_ == in_block_) {
    if (first_ + in_block_ == count_) return nullptr;
    read_block();
  }
  return block_.data() + record_bytes_ * at_++;
}

void ColumnSource::read_block() {
  constexpr std::size_t kBlockBytes = std::size_t{1} << 18;
  first_ += in_block_;
  const std::size_t most = std::max<std::size_t>(1, kBlockBytes / record_bytes_);
  in_block_ = static_cast<std::size_t>(std::min<std::uint64_t>(most, count_ - first_));
  at_ = 0;
  block_.resize(in_block_ * record_bytes_);
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const Column& column = columns_[c];
    scratch_.resize(in_block_ * column.bytes);
    read_column(c, first_, scratch_);
    for (std::size_t i = 0; i < in_block_; ++i) {
      std::memcpy(block_.data() + i * record_bytes_ + column.offset,
                  scratch_.data() + i * column.bytes, column.bytes);
    }
  }
  for (std::size_t i = 0; i < in_block_; ++i) complete(first_ + i, &block_[i * record_bytes_]);
}

}  // namespace ptc
