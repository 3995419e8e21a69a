// Decompression of LZF, byte by byte through a window.
#include "engine/io/cloud/lzf.h"

#include <algorithm>
#include <string>

#include "engine/base/error.h"

namespace ptc {

void LzfReader::fail(const char* rule) const {
  throw DataError(file_->path().string() + ": offset " + std::to_string(at_ - (held_ - next_)) +
                  ": damaged LZF data: " + rule);
}

std::byte LzfReader::input() {
  if (next_ == held_) {
    if (at_ == end_) fail("they end too early");
    held_ = static_cast<std::size_t>(std::min<std::uint64_t>(kInputBytes, end_ - at_));
    next_ = 0;
    file_->read_at(at_, std::span(input_).first(held_));
    at_ += held_;
  }
  return input_[next_++];
}

// Reads the beginning of the next run or match.
void LzfReader::begin_run() {
  const auto control = static_cast<std::size_t>(input());
  if (control < 32) {
    literals_ = control + 1;
    return;
  }
  std::size_t length = control >> 5;
  if (length == 7) length += static_cast<std::size_t>(input());
  matched_ = length + 2;
  distance_ = ((control & 31) << 8) + static_cast<std::size_t>(input()) + 1;
  if (distance_ > done_) fail("a match begins before the data");
}

void LzfReader::read(std::span<std::byte> out) {
  constexpr std::size_t kMask = kWindowBytes - 1;
  std::size_t filled = 0;
  while (filled < out.size()) {
    if (literals_ == 0 && matched_ == 0) begin_run();
    std::size_t& left = literals_ > 0 ? literals_ : matched_;
    const std::size_t count = std::min(left, out.size() - filled);
    for (std::size_t i = 0; i < count; ++i, ++done_) {
      const std::byte value = literals_ > 0 ? input() : window_[(done_ - distance_) & kMask];
      window_[done_ & kMask] = value;
      out[filled + i] = value;
    }
    left -= count;
    filled += count;
  }
}

}  // namespace ptc
