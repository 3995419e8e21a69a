// The way from the end of a file to its directory, and the diagnosis when there is none.
#include "engine/store/commit.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "engine/store/clauses.h"
#include "engine/store/structure.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr char kCopies[] = "spec/container.md#superblock-copies";
constexpr char kDirectoryPages[] = "spec/container.md#directory-pages";

Block read_block(const InputFile& file, std::uint64_t offset) {
  Block block;
  file.read_at(offset, block);
  return block;
}

bool has_superblock_magic(const Block& block) {
  static const Block example = encode_superblock({});
  return std::equal(block.begin(), block.begin() + 8, example.begin());
}

bool is_superblock(const Block& block, const FileHeader& header, std::uint64_t file_bytes) {
  try {
    static_cast<void>(decode_superblock(block, header, file_bytes));
    return true;
  } catch (const FormatError&) {
    return false;
  }
}

[[noreturn]] void refuse_length(std::uint64_t is, std::uint64_t committed) {
  const std::string by = std::to_string(is > committed ? is - committed : committed - is);
  throw FormatError(is, clause::kSuperblockLength,
                    "the file is " + by + (is > committed ? " bytes longer" : " bytes shorter") +
                        " than its superblock says");
}

[[noreturn]] void refuse_without_superblock(std::uint64_t size) {
  throw FormatError(size, clause::kSuperblockMagic,
                    "no superblock at the end: the file is unfinished or truncated");
}

/// Decodes the copy to trust of two at the end of a file, or explains why there is none.
/// @param offset  of the first copy
/// @throws FormatError with an offset in the file
Superblock trusted_copy(const InputFile& file, const FileHeader& header, std::uint64_t offset,
                        const std::array<Block, 2>& blocks) {
  const std::optional<std::size_t> whole = whole_superblock(offset, blocks[0], blocks[1]);
  const std::size_t copy = whole.value_or(has_superblock_magic(blocks[0]) ? 0 : 1);
  try {
    return decode_superblock(blocks[copy], header, file.size());
  } catch (const FormatError& error) {
    // A superblock of another length explains what is wrong, unless a whole one has this length.
    if (!whole || error.clause() == clause::kSuperblockLength) {
      if (const auto length = committed_length(file, header)) refuse_length(file.size(), *length);
    }
    if (!whole && !has_superblock_magic(blocks[copy])) refuse_without_superblock(file.size());
    throw FormatError(offset + copy * kBlockBytes + error.offset(), error.clause(),
                      std::string(whole ? "" : "no superblock is whole: ") + error.text());
  }
}

Superblock choose_superblock(const InputFile& file, const FileHeader& header) {
  const std::uint64_t size = file.size();
  if (size % kBlockBytes != 0 || size < 3 * kBlockBytes) {
    if (const auto length = committed_length(file, header)) refuse_length(size, *length);
    refuse_without_superblock(size);
  }
  const std::uint64_t offset = size - 2 * kBlockBytes;
  return trusted_copy(file, header, offset,
                      {read_block(file, offset), read_block(file, offset + kBlockBytes)});
}

}  // namespace

std::optional<std::size_t> whole_superblock(std::uint64_t offset, std::span<const std::byte> first,
                                            std::span<const std::byte> second) {
  const bool whole = is_whole_superblock(first);
  if (!is_whole_superblock(second)) return whole ? std::optional<std::size_t>(0) : std::nullopt;
  if (!whole) return 1;
  if (!std::ranges::equal(first, second))
    throw FormatError(offset, kCopies, "the two superblocks differ");
  return 0;
}

FileHeader read_file_header(const InputFile& file) {
  Block block;
  const auto bytes = std::span(block).first(std::min<std::uint64_t>(file.size(), block.size()));
  file.read_at(0, bytes);
  return at_offset(file, 0, [&] { return decode_file_header(bytes); });
}

Superblock read_superblock(const InputFile& file, const FileHeader& header) {
  return at_offset(file, 0, [&] { return choose_superblock(file, header); });
}

std::optional<std::uint64_t> committed_length(const InputFile& file, const FileHeader& header) {
  const std::uint64_t blocks = file.size() / kBlockBytes;
  for (std::uint64_t back = 1; back <= std::min(kSuperblockSearch, blocks); ++back) {
    const std::uint64_t offset = (blocks - back) * kBlockBytes;
    const Block block = read_block(file, offset);
    if (!has_superblock_magic(block)) continue;
    for (const std::uint64_t length : {offset + kBlockBytes, offset + 2 * kBlockBytes}) {
      if (is_superblock(block, header, length)) return length;
    }
  }
  return std::nullopt;
}

std::size_t directory_page_entry_bytes(const Superblock& superblock, std::uint32_t index) noexcept {
  const std::size_t full = directory_entries_per_page(superblock.header);
  return std::min(full, superblock.page_count - index * full) * kDirectoryEntryBytes;
}

void read_directory_page(const InputFile& file, const Superblock& superblock, std::uint32_t index,
                         std::span<std::byte> out) {
  const std::uint64_t offset = directory_page_offset(superblock, index);
  std::array<std::byte, kPageHeaderBytes> image;
  file.read_at(offset, image);
  file.read_at(offset + kPageHeaderBytes, out);
  at_offset(file, offset, [&] {
    const PageHeader page = decode_page_header(image, superblock.header);
    if (page.type != PageType::directory || page.rank != index || page.raw_bytes != out.size()) {
      throw FormatError(0, kDirectoryPages, "not the directory page that belongs here");
    }
    if (xxh3_64(out) != page.payload_xxh3) {
      throw FormatError(kPageHeaderBytes, kDirectoryPages, "payload's checksum is wrong");
    }
  });
}

std::vector<DirectoryEntry> read_directory(const InputFile& file, const Superblock& superblock) {
  std::vector<std::byte> all;  // grows with what was verified: a file may be long and empty
  for (std::uint32_t i = 0; i < superblock.directory_pages; ++i) {
    const std::size_t at = all.size();
    all.resize(at + directory_page_entry_bytes(superblock, i));
    read_directory_page(file, superblock, i, std::span(all).subspan(at));
  }
  if (xxh3_64(all) != superblock.directory_xxh3) {
    const FormatError error(superblock.directory_offset, kDirectoryPages,
                            "entries' checksum is not that of the superblock");
    throw error.rebased(0, file.path().string());
  }
  std::vector<DirectoryEntry> entries;
  entries.reserve(superblock.page_count);
  for (std::uint32_t page = 0; page < superblock.page_count; ++page) {
    const auto bytes = std::span(all).subspan(page * kDirectoryEntryBytes, kDirectoryEntryBytes);
    entries.push_back(at_offset(file, entry_offset(superblock, page), [&] {
      return decode_directory_entry(bytes, superblock.header, superblock.file_bytes);
    }));
  }
  return entries;
}

}  // namespace ptc
