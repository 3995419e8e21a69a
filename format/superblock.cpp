// The commit record (spec/container.md#superblock).
//
//   0      8                120                        328        392  512         3072 4088
//   | magic | bytes 8 to 119 | length, directory, root, | writer,  | 0 | the last 64 | 0 | XXH3 of
//   | | u64   | of the header  | counts, totals, digest   | 64 bytes |   | entries     |   | the
//   rest |
//
// decode_superblock() checks from the outside in: first that the block is whole and belongs to this
// file, then that its numbers do not contradict each other. What the pages themselves hold is
// compared with these numbers by the reader and the verifier.
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "format/bytes.h"
#include "format/checksum.h"
#include "format/container.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/page_facts.h"
#include "format/schema.h"
#include "format/text.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMagicNumber = 0x5250555358435450;  // "PTCXSUPR", also the seed of the hash
constexpr std::size_t kHashAt = kBlockBytes - 8;
constexpr std::size_t kIdentityAt = 8;  // bytes 8 to 119 are those of the file header
constexpr std::size_t kIdentityBytes = 112;
constexpr std::size_t kWriterAt = 328;
constexpr std::size_t kWriterBytes = 64;
constexpr std::size_t kTailAt = 512;
constexpr std::size_t kTailEnd = kTailAt + kMaxTailPages * kDirectoryEntryBytes;
constexpr std::array<std::array<std::size_t, 2>, 4> kReserved{
    {{170, 172}, {210, 232}, {kWriterAt + kWriterBytes, kTailAt}, {kTailEnd, kHashAt}}};
constexpr std::uint64_t kMaxCount = std::uint64_t{1} << 48;

namespace field {
constexpr Field<std::uint64_t> kMagic{0};
constexpr Field<std::uint64_t> kFileBytes{120};
constexpr Field<std::uint32_t> kPageCount{128};
constexpr Field<std::uint32_t> kDirectoryPages{132};
constexpr Field<std::uint64_t> kDirectoryOffset{136};
constexpr Field<std::uint64_t> kDirectoryXxh3{144};
constexpr Field<std::uint32_t> kPointPages{152};
constexpr Field<std::uint32_t> kNodePages{156};
constexpr Field<std::uint32_t> kRootPage{160};
constexpr Field<std::uint16_t> kRootSlot{164};
constexpr Field<std::uint16_t> kLevels{166};
constexpr Field<std::uint16_t> kAttributeGroups{168};
constexpr Field<std::uint32_t> kLeafPoints{172};
constexpr Field<std::uint64_t> kPoints{176};
constexpr Field<std::uint64_t> kNodes{184};
constexpr Field<std::uint64_t> kNodeGroups{192};
constexpr Field<std::uint64_t> kTailOffset{200};
constexpr Field<std::uint16_t> kTailPages{208};
constexpr Field<std::array<double, 3>> kBoundsLow{232};
constexpr Field<std::array<double, 3>> kBoundsHigh{256};
constexpr Field<double> kArea{280};
constexpr Field<std::array<double, 3>> kFlux{288};
constexpr Field<std::uint64_t> kContentLow{312};
constexpr Field<std::uint64_t> kContentHigh{320};
constexpr Field<std::uint64_t> kHash{kHashAt};
}  // namespace field

// Checks what binds the block to its file: magic, checksum, file header and length.
void check_sealed(std::span<const std::byte> bytes, const FileHeader& file,
                  std::uint64_t file_bytes) {
  if (bytes.size() < kBlockBytes || field::kMagic.of(bytes.data()) != kMagicNumber) {
    throw FormatError(field::kMagic.at, "spec/container.md#superblock-magic",
                      "no superblock at the end: the file is unfinished or truncated");
  }
  const std::byte* const p = bytes.data();
  if (field::kHash.of(p) != xxh3_64(bytes.first(kHashAt), kMagicNumber)) {
    throw FormatError(kHashAt, "spec/container.md#superblock-checksum",
                      "superblock's checksum is wrong");
  }
  Block identity{};
  encode_identity(file, identity);
  if (!std::ranges::equal(bytes.subspan(kIdentityAt, kIdentityBytes),
                          std::span(identity).subspan(kIdentityAt, kIdentityBytes))) {
    throw FormatError(kIdentityAt, "spec/container.md#superblock-header",
                      "superblock repeats another file header");
  }
  const auto recorded = field::kFileBytes.of(p);
  if (recorded != file_bytes || file_bytes % kBlockBytes != 0) {
    throw FormatError(field::kFileBytes.at, "spec/container.md#superblock-length",
                      "file has " + std::to_string(file_bytes) + " bytes, its superblock says " +
                          std::to_string(recorded));
  }
}

// Checks that the directory has the size of its pages and ends where the tail starts.
void check_directory(const Superblock& s) {
  constexpr char kPages[] = "spec/container.md#superblock-pages";
  if (s.page_count == 0 || s.page_count > kMaxPages) {
    throw FormatError(field::kPageCount.at, kPages, "page_count is out of range");
  }
  const std::uint64_t least =
      (std::uint64_t{1} + s.attribute_groups) * s.point_pages + std::uint64_t{s.node_pages} + 1;
  if (least > s.page_count) {
    throw FormatError(field::kPageCount.at, kPages,
                      "page_count is less than point, attribute, node and meta pages");
  }
  const std::uint32_t full = directory_entries_per_page(s.header);
  if (s.directory_pages != (s.page_count - 1) / full + 1) {
    throw FormatError(field::kDirectoryPages.at, kPages,
                      "directory_pages does not suit page_count");
  }
  const std::uint64_t bytes = directory_bytes(s.header, s.page_count);
  const std::uint64_t end = s.file_bytes < 2 * kBlockBytes ? 0 : s.file_bytes - 2 * kBlockBytes;
  if (s.directory_offset % kBlockBytes != 0 || s.directory_offset < kBlockBytes ||
      s.tail_offset > end || s.directory_offset > s.tail_offset ||
      s.tail_offset - s.directory_offset != bytes) {
    throw FormatError(field::kDirectoryOffset.at, kPages,
                      "directory does not lie between its offset and the tail");
  }
}

// Reads the entries of the tail, and checks that they lie where the tail does.
void read_tail(std::span<const std::byte> bytes, Superblock& s) {
  constexpr char kTail[] = "spec/container.md#tail-pages";
  const std::size_t count = field::kTailPages.of(bytes.data());
  if (count == 0 || count > kMaxTailPages || count > s.page_count) {
    throw FormatError(field::kTailPages.at, kTail,
                      "tail_pages is not 1 to 64, or above page_count");
  }
  std::uint64_t next = s.tail_offset;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = kTailAt + i * kDirectoryEntryBytes;
    try {
      s.tail.push_back(decode_directory_entry(bytes.subspan(at), s.header, s.file_bytes));
    } catch (const FormatError& error) {
      throw error.rebased(at, "");
    }
    const DirectoryEntry& entry = s.tail.back();
    if (entry.type == PageType::point || entry.type == PageType::attribute ||
        entry.offset != next) {
      throw FormatError(at, kTail, "an entry is not of the tail's next page");
    }
    next += round_up(kPageHeaderBytes + std::uint64_t{entry.stored_bytes}, kSectorBytes);
  }
  if (round_up(next, kBlockBytes) != s.file_bytes - 2 * kBlockBytes) {
    throw FormatError(field::kTailPages.at, kTail, "the tail does not end at the superblocks");
  }
  const std::size_t rest = kTailAt + count * kDirectoryEntryBytes;
  const std::size_t set = rest + first_nonzero(bytes.subspan(rest, kTailEnd - rest));
  if (set != kTailEnd) throw FormatError(set, kTail, "bytes behind the entries are not zero");
}

// Checks the counts of points and nodes and the place of the root.
void check_tree(const Superblock& s) {
  constexpr char kRoot[] = "spec/container.md#superblock-root";
  constexpr char kCounts[] = "spec/container.md#superblock-counts";
  if (s.points > kMaxCount || s.nodes > kMaxCount || s.node_groups > s.nodes) {
    throw FormatError(field::kPoints.at, kCounts, "points, nodes or node_groups is out of range");
  }
  const bool empty = s.points == 0;
  if (empty != (s.nodes == 0) || empty != (s.node_groups == 0)) {
    throw FormatError(field::kPoints.at, kCounts, "nodes without points or points without nodes");
  }
  if (empty ? s.root_page != kNoPage || s.root_slot != 0 : s.root_page >= s.node_pages) {
    throw FormatError(field::kRootPage.at, kRoot,
                      "root_page is not a node page, or not absent in an empty file");
  }
  if (s.levels > kMaxLevel + 1 || empty != (s.levels == 0)) {
    throw FormatError(field::kLevels.at, kRoot, "levels is out of range");
  }
  if (s.leaf_points > kMaxLeafPoints || (s.leaf_points == 0 && !empty)) {
    throw FormatError(field::kLeafPoints.at, kCounts, "leaf_points is out of range");
  }
  if (s.attribute_groups > kMaxGroup) {
    throw FormatError(field::kAttributeGroups.at, kCounts, "attribute_groups is above 255");
  }
}

// Checks that bounds, area and flux are numbers that sums of points can have.
void check_totals(const Superblock& s) {
  constexpr char kTotals[] = "spec/container.md#superblock-totals";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(s.bounds_low[axis]) || !std::isfinite(s.bounds_high[axis]) ||
        s.bounds_low[axis] > s.bounds_high[axis]) {
      throw FormatError(field::kBoundsLow.at, kTotals, "bounds are not finite or not ordered");
    }
    if (!std::isfinite(s.flux[axis]) || s.flux[axis] < 0) {
      throw FormatError(field::kFlux.at, kTotals, "flux is not finite or negative");
    }
  }
  if (!std::isfinite(s.area) || s.area < 0) {
    throw FormatError(field::kArea.at, kTotals, "area is not finite or negative");
  }
}

std::string decode_writer(std::span<const std::byte> bytes) {
  const std::string_view field = as_text(bytes.subspan(kWriterAt, kWriterBytes));
  const std::string_view text = field.substr(0, field.find('\0'));
  if (text.size() == kWriterBytes || !is_utf8(text) ||
      field.find_first_not_of('\0', text.size()) != std::string_view::npos) {
    throw FormatError(kWriterAt, "spec/container.md#superblock-writer",
                      "writer is not UTF-8 of at most 63 bytes followed by zeros");
  }
  return std::string(text);
}

}  // namespace

Block encode_superblock(const Superblock& s) {
  if (s.writer.size() >= kWriterBytes || !is_utf8(s.writer)) {
    throw std::invalid_argument("encode_superblock: writer is not UTF-8 of at most 63 bytes");
  }
  if (s.tail.size() > kMaxTailPages) {
    throw std::invalid_argument("encode_superblock: the tail has more than 64 pages");
  }
  // Write the fields; reserved bytes stay zero.
  Block block{};
  std::byte* const p = block.data();
  field::kMagic.put(p, kMagicNumber);
  encode_identity(s.header, block);
  field::kFileBytes.put(p, s.file_bytes);
  field::kPageCount.put(p, s.page_count);
  field::kDirectoryPages.put(p, s.directory_pages);
  field::kDirectoryOffset.put(p, s.directory_offset);
  field::kDirectoryXxh3.put(p, s.directory_xxh3);
  field::kPointPages.put(p, s.point_pages);
  field::kNodePages.put(p, s.node_pages);
  field::kRootPage.put(p, s.root_page);
  field::kRootSlot.put(p, s.root_slot);
  field::kLevels.put(p, s.levels);
  field::kAttributeGroups.put(p, s.attribute_groups);
  field::kLeafPoints.put(p, s.leaf_points);
  field::kPoints.put(p, s.points);
  field::kNodes.put(p, s.nodes);
  field::kNodeGroups.put(p, s.node_groups);
  field::kTailOffset.put(p, s.tail_offset);
  field::kTailPages.put(p, static_cast<std::uint16_t>(s.tail.size()));
  field::kBoundsLow.put(p, s.bounds_low);
  field::kBoundsHigh.put(p, s.bounds_high);
  field::kArea.put(p, s.area);
  field::kFlux.put(p, s.flux);
  field::kContentLow.put(p, s.content_xxh3[0]);
  field::kContentHigh.put(p, s.content_xxh3[1]);
  std::ranges::copy(std::as_bytes(std::span(s.writer)), p + kWriterAt);
  for (std::size_t i = 0; i < s.tail.size(); ++i) {
    const auto entry = std::span(block).subspan(kTailAt + i * kDirectoryEntryBytes);
    encode_directory_entry(s.tail[i], entry.first<kDirectoryEntryBytes>());
  }
  // Seal everything before the checksum.
  field::kHash.put(p, xxh3_64(std::span(block).first(kHashAt), kMagicNumber));
  return block;
}

bool is_whole_superblock(std::span<const std::byte> bytes) noexcept {
  const std::byte* const p = bytes.data();
  return field::kMagic.of(p) == kMagicNumber &&
         field::kHash.of(p) == xxh3_64(bytes.first(kHashAt), kMagicNumber);
}

Superblock decode_superblock(std::span<const std::byte> bytes, const FileHeader& file,
                             std::uint64_t file_bytes) {
  check_sealed(bytes, file, file_bytes);

  // Read the fields.
  const std::byte* const p = bytes.data();
  Superblock s;
  s.header = file;
  s.file_bytes = file_bytes;
  s.page_count = field::kPageCount.of(p);
  s.directory_pages = field::kDirectoryPages.of(p);
  s.directory_offset = field::kDirectoryOffset.of(p);
  s.directory_xxh3 = field::kDirectoryXxh3.of(p);
  s.tail_offset = field::kTailOffset.of(p);
  s.point_pages = field::kPointPages.of(p);
  s.node_pages = field::kNodePages.of(p);
  s.attribute_groups = field::kAttributeGroups.of(p);
  s.root_page = field::kRootPage.of(p);
  s.root_slot = field::kRootSlot.of(p);
  s.levels = field::kLevels.of(p);
  s.leaf_points = field::kLeafPoints.of(p);
  s.points = field::kPoints.of(p);
  s.nodes = field::kNodes.of(p);
  s.node_groups = field::kNodeGroups.of(p);
  s.bounds_low = field::kBoundsLow.of(p);
  s.bounds_high = field::kBoundsHigh.of(p);
  s.area = field::kArea.of(p);
  s.flux = field::kFlux.of(p);
  s.content_xxh3 = {field::kContentLow.of(p), field::kContentHigh.of(p)};
  s.writer = decode_writer(bytes);
  s.xxh3 = field::kHash.of(p);

  // Check their rules and the reserved bytes.
  check_directory(s);
  check_tree(s);
  check_totals(s);
  read_tail(bytes, s);
  for (const auto& [first, last] : kReserved) {
    const std::size_t found = first + first_nonzero(bytes.subspan(first, last - first));
    if (found != last)
      throw FormatError(found, "spec/container.md#superblock-zero", "reserved byte is not zero");
  }
  return s;
}

}  // namespace ptc
