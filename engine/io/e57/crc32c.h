// The checksum of E57 pages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace ptc {

/// Returns the CRC-32C (Castagnoli) of bytes. Source: RFC 3720, appendix B.4.
[[nodiscard]] std::uint32_t crc32c(std::span<const std::byte> bytes) noexcept;

}  // namespace ptc
