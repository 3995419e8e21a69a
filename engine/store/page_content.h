// From a page's stored payload to one that keeps the rules of its type.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "format/codec.h"
#include "format/container.h"
#include "format/error.h"
#include "format/schema.h"

namespace ptc {

/// Columns of the attribute pages of each channel group.
using GroupColumns = std::map<std::uint16_t, std::vector<PackedColumn>>;
[[nodiscard]] GroupColumns columns_by_group(const Meta& meta);

/// What the pages of a file are held to.
struct PageRules {
  std::span<const DirectoryEntry>
      entries;               ///< where references may lead; empty: that is not looked at
  std::uint64_t points = 0;  ///< leaves end at or before
  const GroupColumns* columns = nullptr;  ///< null: none
};

/// Decodes a payload whose checksum is right. Point and node pages pass the checks of
/// PointPage::verify() and NodePage, and each child that a node page refers to exists.
/// @param out  the first raw_bytes of it are filled
/// @throws FormatError, its offset from the page's header on
void decode_payload(const PageHeader& page, std::span<const std::byte> stored,
                    const PageRules& rules, std::span<std::byte> out, PageDecoder& decoder);

/// Errors inside a decoded payload, offsets from its header on: they name the byte only when it is
/// stored as it is.
[[nodiscard]] FormatError placed_in_page(const FormatError& error, const PageHeader& page);

}  // namespace ptc
