// Checks that the pages of a directory make up one scene (spec/container.md#directory).
#pragma once

#include <cstdint>
#include <span>

#include "format/container.h"
#include "format/schema.h"

namespace ptc {

/// Returns how many bytes a page takes in the file, its header and padding included.
[[nodiscard]] std::uint64_t extent_bytes(std::uint32_t stored_bytes) noexcept;

/// Returns the offset of a directory page in the file. All directory pages but the last are full,
/// and they follow each other without a gap.
[[nodiscard]] std::uint64_t directory_page_offset(const Superblock& superblock,
                                                  std::uint32_t index) noexcept;

/// Returns the offset of a page's directory entry in the file.
[[nodiscard]] std::uint64_t entry_offset(const Superblock& superblock, std::uint32_t page) noexcept;

/// Returns the numbers of all pages.
/// @pre  verify_pages()
[[nodiscard]] PageNumbers page_numbers(const Superblock& superblock,
                                       std::span<const DirectoryEntry> entries);

/// Returns the rank of a page: the number of pages of the same type and group before it.
/// @param entries  of all pages
/// @pre  verify_pages()
[[nodiscard]] std::uint32_t rank_of(const PageNumbers& numbers,
                                    std::span<const DirectoryEntry> entries, std::uint32_t page);

/// Checks that the pages of a directory stand in their places, lie between header and directory or
/// in the tail, and do not overlap, that the superblock counts and repeats what the directory has,
/// and that the root is in a node page.
/// @pre    superblock and entries have passed their decoders
/// @throws FormatError with the offset in the file
/// Memory: 4 bytes for each page.
void verify_pages(const Superblock& superblock, std::span<const DirectoryEntry> entries);

/// Checks that the channel groups of the schema are those of the directory, and that every group
/// has one attribute page for each point page.
/// @throws FormatError with the offset in the file
void verify_attributes(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                       const Meta& meta);

}  // namespace ptc
