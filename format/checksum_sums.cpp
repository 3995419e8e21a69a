// XXH3 of many short records. The functions of the library are compiled in here, because a call
// would take as long as the hash of a record.
#define XXH_INLINE_ALL
#include <xxhash.h>

#include "format/checksum.h"

namespace ptc {

std::array<std::uint64_t, 2> xxh3_128_sum(std::span<const std::byte> bytes,
                                          std::size_t size) noexcept {
  std::array<std::uint64_t, 2> sum{};
  for (std::size_t at = 0; at < bytes.size(); at += size) {
    const XXH128_hash_t hash = XXH3_128bits(bytes.data() + at, size);
    sum = {sum[0] + hash.low64, sum[1] + hash.high64};
  }
  return sum;
}

std::uint64_t xxh3_64_sum(std::span<const std::byte> bytes, std::size_t size, std::size_t stride,
                          std::uint64_t seed) noexcept {
  std::uint64_t sum = 0;
  for (std::size_t at = 0; at < bytes.size(); at += stride)
    sum += XXH3_64bits_withSeed(bytes.data() + at, size, seed++);
  return sum;
}

}  // namespace ptc
