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

}  // namespace ptc
