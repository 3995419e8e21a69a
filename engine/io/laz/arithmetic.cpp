// How models adapt to the symbols that were decoded.
#include "engine/io/laz/arithmetic.h"

namespace ptc::laz {
namespace {

constexpr std::uint32_t kMaxTotal = 1U << 15;     // counts are halved above it
constexpr std::uint32_t kMaxBitTotal = 1U << 13;  // the same of bits
constexpr std::uint16_t kNoStart = 0xffff;        // above any place

std::uint32_t whole_rows(std::uint32_t count, std::uint32_t row) {
  return (count + row - 1) / row * row;
}

}  // namespace

void SymbolModel::begin() {
  if (block_.empty()) {
    rows_at_ = whole_rows(symbols_, kRow);
    counts_at_ = rows_at_ + (symbols_ <= kRow ? 0 : whole_rows(rows_at_ / kRow, kRow));
    block_.assign(std::size_t{counts_at_} + symbols_, kNoStart);
  }
  std::fill_n(block_.begin() + counts_at_, symbols_, std::uint16_t{1});
  total_ = symbols_;
  fill_starts();
  cycle_ = (symbols_ + 6) / 2;
  left_ = cycle_;
}

void SymbolModel::adapt() noexcept {
  total_ += cycle_;
  if (total_ > kMaxTotal) {
    total_ = 0;
    for (std::uint32_t i = counts_at_; i < counts_at_ + symbols_; ++i) {
      block_[i] = static_cast<std::uint16_t>((block_[i] + 1) / 2);
      total_ += block_[i];
    }
  }
  fill_starts();
  cycle_ = std::min(cycle_ * 5 / 4, (symbols_ + 6) * 8);
  left_ = cycle_;
}

void SymbolModel::fill_starts() noexcept {
  const std::uint32_t scale = 0x80000000U / total_;
  std::uint32_t sum = 0;
  for (std::uint32_t i = 0; i < symbols_; ++i) {
    block_[i] = static_cast<std::uint16_t>(scale * sum >> 16);
    sum += block_[counts_at_ + i];
  }
  if (symbols_ <= kRow) return;
  for (std::uint32_t i = 0; i * kRow < symbols_; ++i) block_[rows_at_ + i] = block_[i * kRow];
}

void BitModel::adapt() noexcept {
  total_ += cycle_;
  if (total_ > kMaxBitTotal) {
    total_ = (total_ + 1) / 2;
    zeros_ = (zeros_ + 1) / 2;
    if (zeros_ == total_) ++total_;
  }
  share_of_zero_ = zeros_ * (0x80000000U / total_) >> 18;
  cycle_ = std::min(cycle_ * 5 / 4, 64U);
  left_ = cycle_;
}

}  // namespace ptc::laz
