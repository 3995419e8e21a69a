// From a page's stored payload to one that keeps the rules of its type.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "format/codec.h"
#include "format/container.h"
#include "format/error.h"
#include "format/schema.h"

namespace ptc {

/// The columns of the attribute pages of each channel group, by group.
using GroupColumns = std::map<std::uint8_t, std::vector<PackedColumn>>;
/// Returns the columns of all groups of a schema.
[[nodiscard]] GroupColumns columns_by_group(const Meta& meta);

/// Decodes the header at the front of a page's image, and compares it with the page's entry.
/// @param rank  the page's rank; empty where it is not known
/// @throws FormatError with the offset in the image
[[nodiscard]] PageHeader decode_agreed_header(std::span<const std::byte> image,
                                              const FileHeader& file, const DirectoryEntry& entry,
                                              std::optional<std::uint32_t> rank);

/// Compares the checksum of a page's payload with the one in its header.
/// @param image  header and stored payload
/// @throws FormatError with the offset in the image
void check_payload(std::span<const std::byte> image, const PageHeader& page);

/// What the payloads of a file are checked against.
struct PageRules {
  std::uint8_t point_bytes = kPointBytes;  ///< FileHeader::point_bytes
  /// Node pages that references may lead to; empty: references are not checked.
  std::span<const DirectoryEntry> node_pages;
  std::uint32_t own_pages = kNoPage;      ///< ranks from here on are those of parts (spec/parts.md)
  std::uint64_t points = 0;               ///< number of points, where the last leaf ends
  const GroupColumns* columns = nullptr;  ///< of attribute pages; null: these have no columns
};

/// Decodes a payload whose checksum is right. Point and node pages pass the checks of
/// PointPage::verify() and NodePage, and each child that a node page refers to exists.
/// @param out  receives the payload in its first raw_bytes
/// @throws FormatError whose offset counts from the start of the page's header
void decode_payload(const PageHeader& page, std::span<const std::byte> stored,
                    const PageRules& rules, std::span<std::byte> out, PageDecoder& decoder);

/// Returns an error in a decoded payload with its offset counted from the page's header. The offset
/// is that of the byte at fault when the payload is stored raw, else that of the payload.
[[nodiscard]] FormatError placed_in_page(const FormatError& error, const PageHeader& page);

}  // namespace ptc
