// Arithmetic decoding with adaptive models, the innermost part of LAZ.
//
// A coded stream is one number, written byte by byte. The decoder knows an interval in which this
// number lies: its length, and the distance of the number from its low end, the value. A model cuts
// the interval into a share for each symbol. The share that holds the value names the symbol, and
// becomes the next interval:
//
//   0                  value                        length
//   |-- symbol 0 --|-----v-- symbol 1 -----|-- 2 --|
//                  |<----- next length ---->|
//                  |<-->| next value
//
// When the length falls below 2^24, length and value move up by whole bytes, and the next bytes of
// the stream fill the low end of the value. The encoder did the same arithmetic, bit for bit.
// Source: Said 2004, "Introduction to Arithmetic Coding - Theory and Practice", HPL-2004-76.
#pragma once

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace ptc::laz {

/// The bytes that must be readable after the end of every coded stream; their values do not matter.
inline constexpr std::size_t kSlackBytes = 8;

/// The frequencies of the symbols 0, 1, ... n - 1, which adapt to those that are decoded.
class SymbolModel {
 public:
  /// Makes a model of `symbols` symbols, 2 to 768. It allocates nothing before its first use.
  explicit SymbolModel(unsigned symbols) noexcept : symbols_(symbols) {}
  /// Makes all symbols equally frequent again.
  void reset() noexcept { left_ = 0; }

 private:
  friend class ArithmeticDecoder;
  static constexpr unsigned kRow = 16;  // starts that are compared at once

  // Begins to count symbols, all equally frequent.
  void begin();
  // Turns counts into starts.
  void adapt() noexcept;
  void fill_starts() noexcept;
  // Returns the number of starts of a row, in ascending order, that are at most `place`.
  [[nodiscard]] static unsigned count_up_to(const std::uint16_t* row, std::uint16_t place) noexcept;
  // Returns the last symbol whose start is at most `place`.
  [[nodiscard]] unsigned find(std::uint16_t place) const noexcept;

  std::uint32_t symbols_;
  std::uint32_t total_ = 0;      // sum of the counts when starts were made
  std::uint32_t cycle_ = 0;      // symbols between calls of adapt()
  std::uint32_t left_ = 0;       // symbols until the next call; 0 before begin()
  std::uint32_t rows_at_ = 0;    // place of the rows' first starts in block_
  std::uint32_t counts_at_ = 0;  // place of the counts in block_
  // Starts of the symbols' shares in units of length / 2^15, in whole rows; the first start of each
  // row, in whole rows; counts. Unused places of rows are above any place.
  std::vector<std::uint16_t> block_;
};

/// The frequencies of 0 and 1, which adapt to the bits that are decoded.
class BitModel {
 public:
  /// Makes 0 and 1 equally frequent again.
  void reset() noexcept { *this = {}; }

 private:
  friend class ArithmeticDecoder;
  void adapt() noexcept;

  std::uint32_t share_of_zero_ = 1U << 12;  // in units of length / 2^13
  std::uint32_t zeros_ = 1;
  std::uint32_t total_ = 2;
  std::uint32_t cycle_ = 4;
  std::uint32_t left_ = 4;
};

/// Decodes one stream. Damaged streams decode to some symbols; ok() tells them from whole ones.
class ArithmeticDecoder {
 public:
  /// Begins a stream, after whose bytes kSlackBytes more must be readable.
  void start(std::span<const std::byte> bytes) noexcept {
    at_ = bytes.data();
    end_ = at_ + bytes.size();
    length_ = 0xffffffffU;
    damaged_ = false;
    value_ = load();
    advance(4);
  }

  /// Decodes a symbol and counts it in its model.
  unsigned symbol(SymbolModel& model) {
    if (model.left_ == 0) model.begin();
    const std::uint32_t unit = length_ >> 15;
    const unsigned symbol = model.find(static_cast<std::uint16_t>(value_ / unit));
    std::uint16_t* const starts = model.block_.data();
    const std::uint32_t low = starts[symbol] * unit;
    const std::uint32_t high = symbol + 1 == model.symbols_ ? length_ : starts[symbol + 1] * unit;
    value_ -= low;
    length_ = high - low;
    shift_in();
    ++starts[model.counts_at_ + symbol];
    if (--model.left_ == 0) model.adapt();
    return symbol;
  }

  /// Decodes a bit and counts it in its model.
  unsigned bit(BitModel& model) noexcept {
    const std::uint32_t zeros = model.share_of_zero_ * (length_ >> 13);
    const bool one = value_ >= zeros;
    if (one) {
      value_ -= zeros;
      length_ -= zeros;
    } else {
      length_ = zeros;
      ++model.zeros_;
    }
    shift_in();
    if (--model.left_ == 0) model.adapt();
    return one ? 1 : 0;
  }

  /// Decodes `count` bits without a model, 1 to 32.
  std::uint32_t bits(unsigned count) noexcept {
    if (count <= kMaxBitsAtOnce) return bits_at_once(count);
    const std::uint32_t low = bits_at_once(16);
    return low | bits_at_once(count - 16) << 16;
  }

  /// Marks the stream as damaged because of what it decoded to.
  void mark_damaged() noexcept { damaged_ = true; }
  /// Says whether the stream did not end before everything was decoded, and held nothing that no
  /// encoder writes.
  [[nodiscard]] bool ok() const noexcept { return !damaged_ && at_ <= end_; }
  /// Says whether all bytes were read. Encoders end a stream so that this is so after the last
  /// symbol.
  [[nodiscard]] bool at_end() const noexcept { return at_ == end_; }

 private:
  static constexpr unsigned kMaxBitsAtOnce = 19;

  std::uint32_t bits_at_once(unsigned count) noexcept {
    length_ >>= count;
    const std::uint32_t value = value_ / length_;
    value_ -= value * length_;
    shift_in();
    damaged_ = damaged_ || value >> count != 0;
    return value & ((1U << count) - 1);
  }

  // Returns the next four bytes, the first one on top.
  [[nodiscard]] std::uint32_t load() const noexcept {
    std::uint32_t value = 0;
    std::memcpy(&value, at_, sizeof value);
    return __builtin_bswap32(value);
  }

  // Moves on, to one byte past the end at most.
  void advance(std::uint32_t bytes) noexcept { at_ = std::min(at_ + bytes, end_ + 1); }

  // Moves whole bytes into the value until the length is at least 2^24. The length is never 0: a
  // share has at least 2^9 of 2^24, and 19 bits leave 2^5.
  void shift_in() noexcept {
    const auto bits = static_cast<unsigned>(std::countl_zero(length_ | 1)) & ~7U;
    const std::uint64_t joined = std::uint64_t{value_} << 32 | load();
    value_ = static_cast<std::uint32_t>(joined << bits >> 32);
    length_ <<= bits;
    advance(bits >> 3);
  }

  std::uint32_t value_ = 0;
  std::uint32_t length_ = 0;
  const std::byte* at_ = nullptr;
  const std::byte* end_ = nullptr;
  bool damaged_ = false;
};

inline unsigned SymbolModel::count_up_to(const std::uint16_t* row, std::uint16_t place) noexcept {
#if defined(__SSE2__)
  // A saturating difference is 0 where a start is not above the place. The mask has a bit for each.
  const __m128i limit = _mm_set1_epi16(static_cast<short>(place));
  const auto fits = [limit](const std::uint16_t* starts) {
    const __m128i eight = _mm_loadu_si128(reinterpret_cast<const __m128i*>(starts));
    return _mm_cmpeq_epi16(_mm_subs_epu16(eight, limit), _mm_setzero_si128());
  };
  const int mask = _mm_movemask_epi8(_mm_packs_epi16(fits(row), fits(row + 8)));
  return static_cast<unsigned>(__builtin_ctz(~static_cast<unsigned>(mask)));
#else
  return static_cast<unsigned>(std::upper_bound(row, row + kRow, place) - row);
#endif
}

inline unsigned SymbolModel::find(std::uint16_t place) const noexcept {
  // Starts ascend from 0, so the number of those that are not above the place leads to the symbol.
  // A whole row is counted at once, because no branch of a search could be predicted.
  const std::uint16_t* const starts = block_.data();
  if (symbols_ <= kRow) return count_up_to(starts, place) - 1;
  const std::uint16_t* const rows = starts + rows_at_;
  unsigned row = 0;
  if (symbols_ <= 64) {
    while (rows[row + 1] <= place) ++row;
  } else {
    row = count_up_to(rows, place) - 1;
  }
  if (symbols_ > kRow * kRow) {  // only models of GPS times have more than 16 rows
    if (row == kRow - 1) row += count_up_to(rows + kRow, place);
    if (row == 2 * kRow - 1) row += count_up_to(rows + std::size_t{2} * kRow, place);
  }
  return row * kRow + count_up_to(starts + std::size_t{row} * kRow, place) - 1;
}

}  // namespace ptc::laz
