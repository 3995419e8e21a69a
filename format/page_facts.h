// What a page header and a directory entry both say of a page, and the rules that both keep.
#pragma once

#include <cstdint>

#include "format/container.h"

namespace ptc {

struct PageFacts {
  std::uint16_t type = 0;
  std::uint16_t group = 0;
  std::uint32_t stored_bytes = 0;
  std::uint32_t raw_bytes = 0;
  std::uint32_t record_count = 0;
};

/// Checks type, sizes, group and record count (spec/container.md#page-header).
/// @throws FormatError at offset 0
void check_page_facts(const PageFacts& facts, const FileHeader& file);

/// Payload bytes that fit a page.
[[nodiscard]] inline std::uint32_t payload_limit(const FileHeader& file) noexcept {
  return (std::uint32_t{1} << file.page_shift) - static_cast<std::uint32_t>(kPageHeaderBytes);
}

/// Bytes 8 to 119 of the file header, which the superblock repeats.
void encode_identity(const FileHeader& header, std::span<std::byte, kBlockBytes> block) noexcept;

}  // namespace ptc
