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

/// Calls `body`; errors of the format leave with the file's path, `base` bytes further on.
template <class Body>
decltype(auto) at_offset(const InputFile& file, std::uint64_t base, Body&& body) {
  try {
    return body();
  } catch (const FormatError& error) {
    throw error.rebased(base, file.path().string());
  }
}

/// Likewise for what is wrong with a page; `base` is its place in the file.
template <class Body>
decltype(auto) at_page(const InputFile& file, std::uint64_t base, std::uint32_t page, Body&& body) {
  try {
    return body();
  } catch (const FormatError& error) {
    throw error.rebased(base, file.path().string()).in_page(page);
  }
}

/// @throws FormatError with path and offset, as all of these
[[nodiscard]] FileHeader read_file_header(const InputFile& file);

/// The superblock, from its second copy when the first is damaged. Two whole copies that differ are
/// refused. Without a whole copy the error says whether the file is longer or shorter than when it
/// was committed, its superblocks are damaged, or there is none: unfinished or truncated.
[[nodiscard]] Superblock read_superblock(const InputFile& file, const FileHeader& header);

/// Blocks before the end of a file that are searched for a superblock when it is not where it
/// should be.
inline constexpr std::uint64_t kSuperblockSearch = 256;

/// Length that a whole superblock among them gives the file, when there is one.
[[nodiscard]] std::optional<std::uint64_t> committed_length(const InputFile& file,
                                                            const FileHeader& header);

/// Bytes of the entries of directory page `index`.
[[nodiscard]] std::size_t directory_page_entry_bytes(const Superblock& superblock,
                                                     std::uint32_t index) noexcept;
/// Reads the entries of directory page `index`, checksum verified.
/// @param out  as many bytes as directory_page_entry_bytes()
void read_directory_page(const InputFile& file, const Superblock& superblock, std::uint32_t index,
                         std::span<std::byte> out);

/// All entries; each alone is checked, not yet against the others.
/// @pre the superblock has passed its decoder: the file is as long as the directory needs
/// Memory: at most 96 bytes an entry, of which 32 are returned.
[[nodiscard]] std::vector<DirectoryEntry> read_directory(const InputFile& file,
                                                         const Superblock& superblock);

}  // namespace ptc
