// XXH3, the only checksum of the format (spec/checksums.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace ptc {

/// Returns XXH3-64 of the bytes without a seed.
[[nodiscard]] std::uint64_t xxh3_64(std::span<const std::byte> bytes) noexcept;
/// Returns XXH3-64 of the bytes under a seed. Seed 0 gives the hash without a seed.
[[nodiscard]] std::uint64_t xxh3_64(std::span<const std::byte> bytes, std::uint64_t seed) noexcept;
/// XXH3-64 of bytes that come piece by piece: the hash of all of them, as xxh3_64() gives it.
class Xxh3 {
 public:
  explicit Xxh3(std::uint64_t seed);
  ~Xxh3();
  Xxh3(const Xxh3&) = delete;
  Xxh3& operator=(const Xxh3&) = delete;

  /// Adds the next bytes.
  void add(std::span<const std::byte> bytes) noexcept;
  /// Returns the hash of what was added so far.
  [[nodiscard]] std::uint64_t value() const noexcept;

 private:
  void* state_;  ///< of the library
};

/// Returns XXH3-128 of the bytes without a seed, as {low half, high half}.
[[nodiscard]] std::array<std::uint64_t, 2> xxh3_128(std::span<const std::byte> bytes) noexcept;

/// Returns the sum of xxh3_128() over records of `size` bytes, each half added modulo 2^64. The sum
/// does not depend on the order of the records.
/// @param bytes  a whole number of records: its length is a multiple of `size`
[[nodiscard]] std::array<std::uint64_t, 2> xxh3_128_sum(std::span<const std::byte> bytes,
                                                        std::size_t size) noexcept;
/// Returns the sum modulo 2^64 of xxh3_64() over records that are `stride` bytes apart. The hash of
/// record i covers the first `size` bytes of the record and has the seed `seed` + i, so the sum
/// depends on the order of the records.
/// @param bytes  a whole number of records: its length is a multiple of `stride`
[[nodiscard]] std::uint64_t xxh3_64_sum(std::span<const std::byte> bytes, std::size_t size,
                                        std::size_t stride, std::uint64_t seed) noexcept;

}  // namespace ptc
