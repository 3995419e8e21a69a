// The commit record (spec/container.md#superblock).
//
//   0      8                  120                          328          392      4088
//   | magic | bytes 8 to 119  | length, directory, root,  | writer,    | zeros  | XXH3 of all |
//   | u64   | of the header   | counts, totals, digest    | 64 bytes   |        | before, u64 |
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
#include "format/point_page.h"
#include "format/text.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMagic = 0x5250555358435450;  // "PTCXSUPR", also the seed of the hash
constexpr std::size_t kHashAt = kBlockBytes - 8;
constexpr std::size_t kIdentityAt = 8;  // bytes 8 to 119 are those of the file header
constexpr std::size_t kIdentityBytes = 112;
constexpr std::size_t kWriterAt = 328;
constexpr std::size_t kWriterBytes = 64;
constexpr std::array<std::array<std::size_t, 2>, 3> kReserved{
    {{172, 176}, {200, 232}, {kWriterAt + kWriterBytes, kHashAt}}};
constexpr std::uint64_t kMaxCount = std::uint64_t{1} << 48;

// Checks what binds the block to its file: magic, checksum, file header and length.
void check_sealed(std::span<const std::byte> bytes, const FileHeader& file,
                  std::uint64_t file_bytes) {
  if (bytes.size() < kBlockBytes || load<std::uint64_t>(bytes.data(), 0) != kMagic) {
    throw FormatError(0, "spec/container.md#superblock-magic",
                      "no superblock at the end: the file is unfinished or truncated");
  }
  const std::byte* const p = bytes.data();
  if (load<std::uint64_t>(p, kHashAt) != xxh3_64(bytes.first(kHashAt), kMagic)) {
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
  const auto recorded = load<std::uint64_t>(p, 120);
  if (recorded != file_bytes || file_bytes % kBlockBytes != 0) {
    throw FormatError(120, "spec/container.md#superblock-length",
                      "file has " + std::to_string(file_bytes) + " bytes, its superblock says " +
                          std::to_string(recorded));
  }
}

// Checks that the directory has the size of its pages and ends where the superblocks begin.
void check_directory(const Superblock& s) {
  constexpr char kPages[] = "spec/container.md#superblock-pages";
  if (s.page_count == 0 || s.page_count > kMaxPages) {
    throw FormatError(128, kPages, "page_count is out of range");
  }
  const std::uint32_t full = directory_entries_per_page(s.header);
  if (s.directory_pages != (s.page_count - 1) / full + 1) {
    throw FormatError(132, kPages, "directory_pages does not suit page_count");
  }
  const std::uint64_t bytes = directory_bytes(s.header, s.page_count);
  const std::uint64_t end = s.file_bytes < 2 * kBlockBytes ? 0 : s.file_bytes - 2 * kBlockBytes;
  if (s.directory_offset % kBlockBytes != 0 || s.directory_offset < kBlockBytes ||
      s.directory_offset > end || end - s.directory_offset != bytes) {
    throw FormatError(136, kPages, "directory does not end at the superblocks");
  }
  if (s.meta_page >= s.page_count) throw FormatError(152, kPages, "meta_page is not a page");
}

// Checks the counts of points and nodes and the place of the root.
void check_tree(const Superblock& s) {
  constexpr char kRoot[] = "spec/container.md#superblock-root";
  constexpr char kCounts[] = "spec/container.md#superblock-counts";
  if (s.points > kMaxCount || s.nodes > kMaxCount || s.node_groups > s.nodes) {
    throw FormatError(176, kCounts, "points, nodes or node_groups is out of range");
  }
  const bool empty = s.points == 0;
  if (empty != (s.nodes == 0) || empty != (s.node_groups == 0)) {
    throw FormatError(176, kCounts, "nodes without points or points without nodes");
  }
  if (empty ? s.root_page != kNoPage || s.root_slot != 0 : s.root_page >= s.page_count) {
    throw FormatError(156, kRoot, "root_page is not a page, or not absent in an empty file");
  }
  if (s.levels > kMaxLevel + 1 || empty != (s.levels == 0)) {
    throw FormatError(162, kRoot, "levels is out of range");
  }
  if (s.leaf_points > kMaxLeafPoints || (s.leaf_points == 0 && !empty)) {
    throw FormatError(164, kCounts, "leaf_points is out of range");
  }
  if (s.points_per_page > points_per_page(s.header) || (s.points_per_page == 0 && !empty)) {
    throw FormatError(168, kCounts, "points_per_page is out of range");
  }
}

// Checks that bounds, area and flux are numbers that sums of points can have.
void check_totals(const Superblock& s) {
  constexpr char kTotals[] = "spec/container.md#superblock-totals";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(s.bounds_low[axis]) || !std::isfinite(s.bounds_high[axis]) ||
        s.bounds_low[axis] > s.bounds_high[axis]) {
      throw FormatError(232, kTotals, "bounds are not finite or not ordered");
    }
    if (!std::isfinite(s.flux[axis]) || s.flux[axis] < 0) {
      throw FormatError(288, kTotals, "flux is not finite or negative");
    }
  }
  if (!std::isfinite(s.area) || s.area < 0) {
    throw FormatError(280, kTotals, "area is not finite or negative");
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
  // Write the fields; reserved bytes stay zero.
  Block block{};
  std::byte* const p = block.data();
  store(p, 0, kMagic);
  encode_identity(s.header, block);
  store(p, 120, s.file_bytes);
  store(p, 128, s.page_count);
  store(p, 132, s.directory_pages);
  store(p, 136, s.directory_offset);
  store(p, 144, s.directory_xxh3);
  store(p, 152, s.meta_page);
  store(p, 156, s.root_page);
  store(p, 160, s.root_slot);
  store(p, 162, s.levels);
  store(p, 164, s.leaf_points);
  store(p, 168, s.points_per_page);
  store(p, 176, s.points);
  store(p, 184, s.nodes);
  store(p, 192, s.node_groups);
  store(p, 232, s.bounds_low);
  store(p, 256, s.bounds_high);
  store(p, 280, s.area);
  store(p, 288, s.flux);
  store(p, 312, s.content_xxh3[0]);
  store(p, 320, s.content_xxh3[1]);
  std::ranges::copy(std::as_bytes(std::span(s.writer)), p + kWriterAt);
  // Seal everything before the checksum.
  store(p, kHashAt, xxh3_64(std::span(block).first(kHashAt), kMagic));
  return block;
}

Superblock decode_superblock(std::span<const std::byte> bytes, const FileHeader& file,
                             std::uint64_t file_bytes) {
  check_sealed(bytes, file, file_bytes);

  // Read the fields.
  const std::byte* const p = bytes.data();
  Superblock s;
  s.header = file;
  s.file_bytes = file_bytes;
  s.page_count = load<std::uint32_t>(p, 128);
  s.directory_pages = load<std::uint32_t>(p, 132);
  s.directory_offset = load<std::uint64_t>(p, 136);
  s.directory_xxh3 = load<std::uint64_t>(p, 144);
  s.meta_page = load<std::uint32_t>(p, 152);
  s.root_page = load<std::uint32_t>(p, 156);
  s.root_slot = load<std::uint16_t>(p, 160);
  s.levels = load<std::uint16_t>(p, 162);
  s.leaf_points = load<std::uint32_t>(p, 164);
  s.points_per_page = load<std::uint32_t>(p, 168);
  s.points = load<std::uint64_t>(p, 176);
  s.nodes = load<std::uint64_t>(p, 184);
  s.node_groups = load<std::uint64_t>(p, 192);
  s.bounds_low = load<std::array<double, 3>>(p, 232);
  s.bounds_high = load<std::array<double, 3>>(p, 256);
  s.area = load<double>(p, 280);
  s.flux = load<std::array<double, 3>>(p, 288);
  s.content_xxh3 = {load<std::uint64_t>(p, 312), load<std::uint64_t>(p, 320)};
  s.writer = decode_writer(bytes);

  // Check their rules and the reserved bytes.
  check_directory(s);
  check_tree(s);
  check_totals(s);
  for (const auto& [first, last] : kReserved) {
    const std::size_t found = first + first_nonzero(bytes.subspan(first, last - first));
    if (found != last)
      throw FormatError(found, "spec/container.md#superblock-zero", "reserved byte is not zero");
  }
  return s;
}

}  // namespace ptc
