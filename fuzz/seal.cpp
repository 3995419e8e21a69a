// Finds and repairs checksums without trust in any number of the file, and without the decoders
// that are to be tested (spec/container.md).
#include "fuzz/seal.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "format/bytes.h"
#include "format/checksum.h"

namespace ptc::fuzz {
namespace {

constexpr std::size_t kBlock = 4096;
constexpr std::size_t kPageHeader = 64;
constexpr std::size_t kTailEnd = 3072;  // of the repeated entries in a superblock

// Returns the seed that eight letters spell.
std::uint64_t seed(const char* text) {
  std::uint64_t value;
  std::memcpy(&value, text, sizeof value);
  return value;
}

// Writes the hash of `bytes` bytes from `from` on to `at`.
void hash_to(std::span<std::byte> file, std::size_t at, std::size_t from, std::size_t bytes,
             std::uint64_t under = 0) {
  store(file.data(), at, xxh3_64(file.subspan(from, bytes), under));
}

// Writes the checksum of a page header. Its seed is made of uuid, rank, type and group as the
// headers have them.
void seal_page_header(std::span<std::byte> file, std::size_t at) {
  std::array<std::byte, 22> salt;
  std::memcpy(salt.data(), &file[40], 16);
  std::memcpy(&salt[16], &file[at + 8], 4);
  std::memcpy(&salt[20], &file[at + 4], 2);
  hash_to(file, at + 56, at, 56, xxh3_64(salt));
}

// Returns all directory entries, concatenated.
std::vector<std::byte> gather_entries(std::span<const std::byte> file, const Layout& layout) {
  std::vector<std::byte> all;
  for (const auto& page : layout.directory) {
    const auto part = file.subspan(page.header + kPageHeader, page.bytes);
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

// Writes the content digest of the directory's entries to the first superblock.
void seal_digest(std::span<std::byte> file, const Layout& layout) {
  const std::vector<std::byte> entries = gather_entries(file, layout);
  std::vector<std::byte> records(entries.size() / kEntryBytes * 16);
  for (std::size_t i = 0; i < entries.size() / kEntryBytes; ++i) {
    const std::byte* const entry = &entries[kEntryBytes * i];
    std::memcpy(&records[16 * i], entry + 36, 2);      // type, group
    std::memcpy(&records[16 * i + 4], entry + 32, 4);  // record_count
    std::memcpy(&records[16 * i + 8], entry + 16, 8);  // payload_xxh3
  }
  const auto digest = xxh3_128(records);
  std::memcpy(&file[layout.superblock + 312], digest.data(), sizeof digest);
}

// Writes the last entries of the directory to the first superblock, and zeros behind them.
void seal_tail(std::span<std::byte> file, const Layout& layout) {
  std::size_t at = layout.superblock + kTailEntriesAt;
  for (const std::size_t entry : std::span(layout.entries).last(layout.tail_entries)) {
    std::memcpy(&file[at], &file[entry], kEntryBytes);
    at += kEntryBytes;
  }
  std::memset(&file[at], 0, layout.superblock + kTailEnd - at);
}

}  // namespace

Layout find_layout(std::span<const std::byte> file) {
  // Read where the directory starts, and clamp it to the file.
  Layout layout;
  const std::byte* const bytes = file.data();
  const std::size_t end = layout.superblock = file.size() / kBlock * kBlock - 2 * kBlock;
  const unsigned shift =
      std::clamp(load<std::uint8_t>(bytes, 56), std::uint8_t{12}, std::uint8_t{20});
  const std::size_t per_page = ((std::size_t{1} << shift) - kPageHeader) / kEntryBytes;
  std::size_t left = load<std::uint32_t>(bytes, end + 128);
  std::size_t at = std::min<std::size_t>(load<std::uint64_t>(bytes, end + 136), end);

  // Walk the directory pages, and keep the pages that lie in the file. Void pages do not.
  while (left > 0 && end - at >= kPageHeader + kEntryBytes) {
    const std::size_t count = std::min({left, per_page, (end - at - kPageHeader) / kEntryBytes});
    layout.directory.push_back({at, count * kEntryBytes});
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t entry = at + kPageHeader + i * kEntryBytes;
      layout.entries.push_back(entry);
      const auto offset = load<std::uint64_t>(bytes, entry);
      const std::size_t stored = load<std::uint32_t>(bytes, entry + 8);
      if (offset < kBlock || offset > end || end - offset < kPageHeader ||
          stored > end - offset - kPageHeader) {
        continue;
      }
      layout.pages.push_back({entry, offset, stored});
    }
    left -= count;
    at += std::min(std::size_t{1} << shift, end - at);
  }
  layout.tail_entries =
      std::min<std::size_t>({load<std::uint16_t>(bytes, end + 208), 64, layout.entries.size()});
  return layout;
}

void seal(std::span<std::byte> file, unsigned seals) {
  if (file.size() < kMinFile) return;
  // Repair the file header and the pages.
  if (seals & kSealFileHeader) hash_to(file, 120, 0, 120, seed("PTCXHEAD"));
  const Layout layout = find_layout(file);
  for (const Layout::Page& page : layout.pages) {
    if (seals & kSealPayloads) {
      hash_to(file, page.header + 48, page.header + kPageHeader, page.stored_bytes);
      std::memmove(&file[page.entry + 16], &file[page.header + 48], 8);  // they may overlap
    }
    if (seals & kSealPageHeaders) seal_page_header(file, page.header);
  }

  // Repair the directory.
  for (const Layout::DirectoryPage& page : layout.directory) {
    if (seals & kSealDirectory)
      hash_to(file, page.header + 48, page.header + kPageHeader, page.bytes);
    if (seals & kSealPageHeaders) seal_page_header(file, page.header);
  }

  // Repair the superblocks.
  const std::size_t first = layout.superblock;
  if (seals & kSealDirectory)
    store(file.data(), first + 144, xxh3_64(gather_entries(file, layout)));
  if (seals & kSealDigest) seal_digest(file, layout);
  if (seals & kSealTail) seal_tail(file, layout);
  if (seals & kSealCopies) {
    std::memcpy(&file[first + 8], &file[8], 112);
    std::memcpy(&file[first + kBlock], &file[first], kBlock);
  }
  if (seals & kSealSuperblock) {
    hash_to(file, first + 4088, first, 4088, seed("PTCXSUPR"));
    hash_to(file, first + kBlock + 4088, first + kBlock, 4088, seed("PTCXSUPR"));
  }
}

}  // namespace ptc::fuzz
