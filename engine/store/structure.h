// What the directory has to say for its pages to make up one scene (spec/container.md#directory).
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "format/container.h"
#include "format/schema.h"

namespace ptc {

/// Page numbers by kind, ascending.
struct PageIndex {
  std::vector<std::uint32_t> points;
  std::vector<std::uint32_t> nodes;
  std::map<std::uint16_t, std::vector<std::uint32_t>> attributes;  ///< by group
};

/// What a page takes in the file, header and padding included.
[[nodiscard]] std::uint64_t extent_bytes(std::uint32_t stored_bytes) noexcept;

/// Where a directory page lies: all but the last are full, and they follow each other without gap.
[[nodiscard]] std::uint64_t directory_page_offset(const Superblock& superblock,
                                                  std::uint32_t index) noexcept;

/// Where the directory entry of a page lies.
[[nodiscard]] std::uint64_t entry_offset(const Superblock& superblock, std::uint32_t page) noexcept;

[[nodiscard]] PageIndex index_pages(std::span<const DirectoryEntry> entries);

/// Checks, of entries and a superblock that have passed their decoders, that pages lie between
/// header and directory and do not overlap, that the page counts of the superblock are those of the
/// directory, and that root and meta page are of their kind.
/// @throws FormatError with the offset in the file
/// Memory: 4 bytes a page.
void verify_pages(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                  const PageIndex& index);

/// Checks that every channel group has one attribute page beside each point page, and no other.
/// @throws FormatError with the offset in the file
void verify_attributes(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                       const PageIndex& index, const Meta& meta);

}  // namespace ptc
