// What commits a file: header, superblocks and directory, read and checked (spec/container.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/io/file/file.h"
#include "format/container.h"
#include "format/error.h"

namespace ptc {

/// Calls body() and returns its result. A FormatError of the body gets the path of the file, and
/// its offset is counted from `base` bytes into the file.
template <class Body>
decltype(auto) at_offset(const InputFile& file, std::uint64_t base, Body&& body) {
  try {
    return body();
  } catch (const FormatError& error) {
    throw error.rebased(base, file.path().string());
  }
}

/// Calls body() as at_offset() does. A FormatError also gets the number of the page.
/// @param base  where the page lies in the file, bytes
template <class Body>
decltype(auto) at_page(const InputFile& file, std::uint64_t base, std::uint32_t page, Body&& body) {
  try {
    return body();
  } catch (const FormatError& error) {
    throw error.rebased(base, file.path().string()).in_page(page);
  }
}

/// Reads the file header.
/// @throws FormatError with path and offset, as all functions here
[[nodiscard]] FileHeader read_file_header(const InputFile& file);

/// Says which of the two superblocks of a file counts: 0 or 1, the first that is whole, or nothing
/// when none is.
/// @param offset  of the first one
/// @throws FormatError when both are whole and differ; the offset is from the start of the file
[[nodiscard]] std::optional<std::size_t> whole_superblock(std::uint64_t offset,
                                                          std::span<const std::byte> first,
                                                          std::span<const std::byte> second);

/// Reads the superblock, from its second copy when the first is damaged. Two whole copies that
/// differ are refused. Without a whole copy, the error says whether the file is longer or shorter
/// than when it was committed, whether its superblocks are damaged, or that it has none and so is
/// unfinished or truncated.
[[nodiscard]] Superblock read_superblock(const InputFile& file, const FileHeader& header);

/// How many blocks before the end of a file are searched for a superblock that is not in its place.
inline constexpr std::uint64_t kSuperblockSearch = 256;

/// Searches the last kSuperblockSearch blocks of a file for a whole superblock, and returns the
/// length that it gives the file; empty when none is found.
[[nodiscard]] std::optional<std::uint64_t> committed_length(const InputFile& file,
                                                            const FileHeader& header);

/// Returns how many bytes of entries the directory page of this index holds.
[[nodiscard]] std::size_t directory_page_entry_bytes(const Superblock& superblock,
                                                     std::uint32_t index) noexcept;
/// Reads the entries of the directory page of this index, and verifies their checksum.
/// @param out  as many bytes as directory_page_entry_bytes()
void read_directory_page(const InputFile& file, const Superblock& superblock, std::uint32_t index,
                         std::span<std::byte> out);

/// Reads all entries of the directory. Each entry is checked by itself, not yet against the others.
/// @pre    the superblock has passed its decoder, so the file is as long as the directory needs
/// Memory: at most 128 bytes for each entry; 48 of these are returned.
[[nodiscard]] std::vector<DirectoryEntry> read_directory(const InputFile& file,
                                                         const Superblock& superblock);

}  // namespace ptc
