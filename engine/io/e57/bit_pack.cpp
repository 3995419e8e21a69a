#include "engine/io/e57/bit_pack.h"

#include <algorithm>
#include <cstring>

namespace ptc {
namespace {

// Returns the eight bytes at `at`; those behind the end are 0.
std::uint64_t load_word(std::span<const std::byte> bytes, std::size_t at) noexcept {
  std::uint64_t word = 0;
  if (bytes.size() - at >= sizeof word) {
    std::memcpy(&word, bytes.data() + at, sizeof word);
  } else {
    std::memcpy(&word, bytes.data() + at, bytes.size() - at);
  }
  return word;
}

}  // namespace

void unpack_bits(std::span<const std::byte> bytes, std::size_t first_bit, unsigned width,
                 std::span<std::uint64_t> out) noexcept {
  if (width == 0) {
    std::ranges::fill(out, 0);
    return;
  }
  const std::uint64_t mask = ~std::uint64_t{0} >> (64 - width);
  for (std::uint64_t& value : out) {
    const std::size_t at = first_bit / 8;
    const auto shift = static_cast<unsigned>(first_bit % 8);
    std::uint64_t word = load_word(bytes, at) >> shift;
    if (shift + width > 64) word |= std::to_integer<std::uint64_t>(bytes[at + 8]) << (64 - shift);
    value = word & mask;
    first_bit += width;
  }
}

}  // namespace ptc
