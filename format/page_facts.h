// The facts of a page that its header and its directory entry both record, and the rules that both
// keep.
#pragma once

#include <cstdint>

#include "format/container.h"

namespace ptc {

/// The facts of a page as read from its header or its directory entry, before any check.
struct PageFacts {
  std::uint16_t type = 0;   ///< a PageType, when the bytes are valid
  std::uint16_t group = 0;  ///< channel group of an attribute page; else 0
  std::uint32_t stored_bytes = 0;
  std::uint32_t raw_bytes = 0;
  std::uint32_t record_count = 0;
};

/// Checks type, sizes, group and record count of a page (spec/container.md#page-header).
/// @throws FormatError with offset 0, because header and entry keep the fields in different places
void check_page_facts(const PageFacts& facts, const FileHeader& file);

/// Returns the greatest number of payload bytes in a page.
[[nodiscard]] inline std::uint32_t payload_limit(const FileHeader& file) noexcept {
  return (std::uint32_t{1} << file.page_shift) - static_cast<std::uint32_t>(kPageHeaderBytes);
}

/// Writes bytes 8 to 119 of the file header, which the superblock repeats, to the same place in
/// `block`.
void encode_identity(const FileHeader& header, std::span<std::byte, kBlockBytes> block) noexcept;

}  // namespace ptc
