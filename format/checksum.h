// XXH3, the one checksum of the format (spec/checksums.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace ptc {

/// XXH3-64 without a seed.
[[nodiscard]] std::uint64_t xxh3_64(std::span<const std::byte> bytes) noexcept;
/// XXH3-64 under a seed; seed 0 is no seed.
[[nodiscard]] std::uint64_t xxh3_64(std::span<const std::byte> bytes, std::uint64_t seed) noexcept;
/// {low, high} halves of XXH3-128.
[[nodiscard]] std::array<std::uint64_t, 2> xxh3_128(std::span<const std::byte> bytes) noexcept;

/// The sum, half by half, of xxh3_128() of every `size` bytes: the same for a set of records in
/// whatever order.
/// @param bytes  a multiple of `size`
[[nodiscard]] std::array<std::uint64_t, 2> xxh3_128_sum(std::span<const std::byte> bytes,
                                                        std::size_t size) noexcept;
/// The sum of xxh3_64() of the first `size` of every `stride` bytes, the first under `seed`, the
/// next under seed + 1 and so on.
/// @param bytes  a multiple of `stride`
[[nodiscard]] std::uint64_t xxh3_64_sum(std::span<const std::byte> bytes, std::size_t size,
                                        std::size_t stride, std::uint64_t seed) noexcept;

}  // namespace ptc
