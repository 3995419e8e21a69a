// Opening from the end, and requests for the ranges that are asked for.
#include "engine/store/partial_reader.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

#include "engine/store/clauses.h"
#include "engine/store/commit.h"
#include "engine/store/structure.h"
#include "format/checksum.h"
#include "format/error.h"

namespace ptc {
namespace {

// A request costs about as much as the transfer of this many bytes: 2 ms at 16 MB/s.
constexpr std::uint64_t kGapBytes = std::uint64_t{32} << 10;
// Entries near one that is asked for: pages of the same region have neighbouring ranks.
constexpr std::uint32_t kEntriesAround = 128;
constexpr std::uint64_t kEntryGapBytes = std::uint64_t{4} << 10;

/// Calls body(). A FormatError gets the name of the source and is counted from `base`.
template <class Body>
decltype(auto) in_source(const RangeSource& source, std::uint64_t base, Body&& body) {
  try {
    return body();
  } catch (const FormatError& error) {
    throw error.rebased(base, source.name());
  }
}

}  // namespace

PartialReader::PartialReader(RangeSource& source) : source_(source) {
  open();
  numbers_ = PageNumbers(superblock_, {});
  const auto tail = static_cast<std::uint32_t>(superblock_.tail.size());
  for (std::uint32_t i = 0; i < tail; ++i) {
    const std::uint32_t page = superblock_.page_count - tail + i;
    in_source(source_, source_.size() - kBlockBytes,
              [&] { check_entry(page, superblock_.tail[i]); });
    take_entry(page, superblock_.tail[i]);
  }
  read_meta();
  take_last_entries();
  take_whole_pages(source_.size() - end_.size(), end_);
}

/// Reads the end of the source, and takes the last superblock that is whole.
void PartialReader::open() {
  end_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(source_.size(), kFirstRequest)));
  if (end_.size() < 2 * kBlockBytes)
    throw FormatError(0, clause::kSuperblockMagic, "the file is too short")
        .rebased(0, source_.name());
  if (source_.size() % kBlockBytes != 0) {
    throw FormatError(source_.size(), clause::kSuperblockLength,
                      "the file is no multiple of 4096 bytes long")
        .rebased(0, source_.name());
  }
  source_.read(source_.size() - end_.size(), end_);
  const std::uint64_t offset = source_.size() - 2 * kBlockBytes;
  const auto copies = std::span<const std::byte>(end_).last(2 * kBlockBytes);
  const std::optional<std::size_t> whole = in_source(source_, 0, [&] {
    return whole_superblock(offset, copies.first(kBlockBytes), copies.last(kBlockBytes));
  });
  const std::size_t at = whole.value_or(0) * kBlockBytes;
  in_source(source_, offset + at, [&] {
    const auto copy = copies.subspan(at, kBlockBytes);
    // Without a whole copy the superblock's own rules say what is wrong.
    const FileHeader repeated = whole ? decode_repeated_header(copy) : FileHeader{};
    superblock_ = decode_superblock(copy, repeated, source_.size());
  });
}

void PartialReader::read_meta() {
  const std::uint32_t page = numbers_.meta();
  load({{page}});
  meta_ = in_source(source_, entries_.at(page).offset,
                    [&] { return decode_meta(payload(page), header().point_bytes); });
  columns_ = columns_by_group(meta_);
  std::vector<std::uint8_t> groups = channel_groups(meta_.channels);
  if (groups.size() != superblock_.attribute_groups) {
    throw FormatError(entries_.at(page).offset, clause::kAttributePages,
                      "the schema has another number of groups than the superblock")
        .rebased(0, source_.name());
  }
  numbers_ = PageNumbers(superblock_, std::move(groups));
}

/// Checks that an entry has the type, group and count of its place.
void PartialReader::check_entry(std::uint32_t page, const DirectoryEntry& entry) const {
  const bool point = numbers_.points().contains(page);
  const bool node = numbers_.nodes().contains(page);
  const bool other = numbers_.others().contains(page);
  const PageType wanted = point                     ? PageType::point
                          : node                    ? PageType::node
                          : page == numbers_.meta() ? PageType::meta
                          : other                   ? entry.type
                                                    : PageType::attribute;
  const bool parts = entry.type == PageType::parts && header().has_parts();
  const bool fits = other ? parts || is_skippable(entry.type) : entry.type == wanted;
  if (!fits)
    throw FormatError(0, clause::kDirectoryListing, "an entry is of another type than its place");
  if (!point && wanted != PageType::attribute) return;
  const std::uint32_t rank = page % superblock_.point_pages;
  const std::uint64_t full = points_per_page(header());
  const std::uint64_t left = superblock_.points - std::min(superblock_.points, rank * full);
  if (entry.record_count != std::min(full, left)) {
    throw FormatError(0, point ? "spec/points.md#point-pages" : clause::kAttributePages,
                      "an entry has another number of points than its place");
  }
  if (point || numbers_.groups().empty()) return;
  if (entry.group != numbers_.groups()[page / superblock_.point_pages - 1])
    throw FormatError(0, clause::kAttributePages, "an entry is of another group than its place");
  const std::size_t bytes = entry.record_count * group_point_bytes(meta_.channels, entry.group);
  if (!entry.is_void() && entry.raw_bytes != bytes)
    throw FormatError(0, clause::kAttributePages, "the page is not as long as its channels are");
}

std::vector<PartialReader::Extent> PartialReader::merged(std::vector<Extent> extents,
                                                         std::uint64_t gap) {
  std::ranges::sort(extents, {}, &Extent::begin);
  std::vector<Extent> out;
  for (Extent& extent : extents) {
    if (out.empty() || extent.begin > out.back().end + gap) {
      out.push_back(std::move(extent));
      continue;
    }
    out.back().end = std::max(out.back().end, extent.end);
    out.back().pages.insert(out.back().pages.end(), extent.pages.begin(), extent.pages.end());
  }
  return out;
}

/// Counts a round if one of these extents must be asked for.
void PartialReader::count_round(std::span<const Extent> extents) {
  const std::uint64_t from = source_.size() - end_.size();
  const bool asks = std::ranges::any_of(extents, [&](const Extent& e) { return e.begin < from; });
  rounds_ += asks ? 1 : 0;
}

/// Returns the bytes of an extent: from the first request, or by another one.
std::span<const std::byte> PartialReader::bytes_of(const Extent& extent,
                                                   std::vector<std::byte>& buffer) {
  const std::uint64_t from = source_.size() - end_.size();
  const auto bytes = static_cast<std::size_t>(extent.end - extent.begin);
  if (extent.begin >= from)
    return std::span(end_).subspan(static_cast<std::size_t>(extent.begin - from), bytes);
  buffer.resize(bytes);
  source_.read(extent.begin, buffer);
  return buffer;
}

/// Notes an entry that passed its checks.
void PartialReader::take_entry(std::uint32_t page, const DirectoryEntry& entry) {
  entries_.emplace(page, entry);
  if (!numbers_.nodes().contains(page)) return;
  nodes_by_key_.emplace(entry.level, entry.first_key, page);
  nodes_by_offset_.emplace(entry.offset, page);
}

/// Takes the entries of pages `first` to `last`.
/// @param begin  where the bytes lie in the source
void PartialReader::take_entries(std::uint64_t begin, std::span<const std::byte> bytes,
                                 std::uint32_t first, std::uint32_t last) {
  for (std::uint32_t page = first; page <= last; ++page) {
    if (entries_.contains(page)) continue;
    const std::uint64_t at = entry_offset(superblock_, page);
    in_source(source_, at, [&] {
      const DirectoryEntry entry = decode_directory_entry(
          bytes.subspan(static_cast<std::size_t>(at - begin)), header(), superblock_.file_bytes);
      check_entry(page, entry);
      take_entry(page, entry);
    });
  }
}

/// Takes the entries that came with the first request.
void PartialReader::take_last_entries() {
  const std::uint64_t from = source_.size() - end_.size();
  std::uint32_t first = superblock_.page_count;
  while (first > 0 && entry_offset(superblock_, first - 1) >= from) --first;
  if (first < superblock_.page_count) take_entries(from, end_, first, superblock_.page_count - 1);
}

/// Returns the pages that are of the type and group of this one, or all that stand behind those.
PageNumbers::Range PartialReader::kind_of(std::uint32_t page) const {
  const PageNumbers::Range nodes = numbers_.nodes();
  if (nodes.contains(page)) return nodes;
  if (page >= nodes.first)
    return {nodes.first + nodes.count, superblock_.page_count - nodes.first - nodes.count};
  const std::uint32_t per_kind = superblock_.point_pages;
  return {page - page % per_kind, per_kind};
}

void PartialReader::load_entries(std::span<const std::uint32_t> pages) {
  // Find the entries that are not known, with those around them that are not known either
  std::vector<Extent> extents;
  for (const std::uint32_t page : pages) {
    if (page >= superblock_.page_count)
      throw std::invalid_argument("PartialReader: there is no page " + std::to_string(page));
    if (entries_.contains(page)) continue;
    const PageNumbers::Range kind = kind_of(page);
    std::uint32_t first = page - std::min(page - kind.first, kEntriesAround);
    std::uint32_t last = std::min(page + kEntriesAround, kind.first + kind.count - 1);
    while (entries_.contains(first)) ++first;
    while (entries_.contains(last)) --last;
    extents.push_back({entry_offset(superblock_, first),
                       entry_offset(superblock_, last) + kDirectoryEntryBytes,
                       {first, last}});
  }
  // Read them
  count_round(extents);
  std::vector<std::byte> buffer;
  for (const Extent& extent : merged(std::move(extents), kEntryGapBytes)) {
    const auto [first, last] = std::ranges::minmax(extent.pages);
    take_entries(extent.begin, bytes_of(extent, buffer), first, last);
  }
}

std::optional<std::uint32_t> PartialReader::known_node_page(int level, std::uint64_t key) const {
  const auto after = nodes_by_key_.upper_bound({level, key, ~std::uint32_t{0}});
  if (after == nodes_by_key_.begin()) return {};
  const auto& [found_level, first_key, page] = *std::prev(after);
  return found_level == level ? std::optional(page) : std::nullopt;
}

void PartialReader::load(std::span<const std::uint32_t> pages) {
  std::vector<std::uint32_t> wanted;
  for (const std::uint32_t page : pages) {
    if (!pages_.contains(page)) wanted.push_back(page);
  }
  std::ranges::sort(wanted);
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  load_entries(wanted);
  // Pages of the first request are at hand. Of the others, neighbours are read together.
  const std::uint64_t from = source_.size() - end_.size();
  std::vector<Extent> near, far;
  for (const std::uint32_t page : wanted) {
    const DirectoryEntry& entry = entries_.at(page);
    if (entry.is_void()) {
      Loaded& loaded = pages_[page];
      loaded.record_count = entry.record_count;
      loaded.payload.resize(entry.record_count * group_point_bytes(meta_.channels, entry.group));
      fill_void(meta_.channels, entry.group, loaded.payload);
      continue;
    }
    const Extent extent{entry.offset, entry.offset + kPageHeaderBytes + entry.stored_bytes, {page}};
    (entry.offset >= from ? near : far).push_back(extent);
  }
  count_round(far);
  std::vector<std::byte> buffer;
  for (std::vector<Extent>* extents : {&near, &far}) {
    for (const Extent& extent : merged(std::move(*extents), kGapBytes)) {
      const std::span<const std::byte> bytes = bytes_of(extent, buffer);
      for (const std::uint32_t page : extent.pages) {
        const DirectoryEntry& entry = entries_.at(page);
        take_page(page, bytes.subspan(static_cast<std::size_t>(entry.offset - extent.begin),
                                      kPageHeaderBytes + entry.stored_bytes));
      }
      take_whole_pages(extent.begin, bytes);
    }
  }
}

/// Loads the node pages that lie within bytes of the source, but for those that are damaged.
/// @param begin  where the bytes lie in the source
void PartialReader::take_whole_pages(std::uint64_t begin, std::span<const std::byte> bytes) {
  for (auto node = nodes_by_offset_.lower_bound(begin); node != nodes_by_offset_.end(); ++node) {
    const auto& [offset, page] = *node;
    const std::size_t length = kPageHeaderBytes + entries_.at(page).stored_bytes;
    if (offset - begin >= bytes.size()) break;
    const auto at = static_cast<std::size_t>(offset - begin);
    if (length > bytes.size() - at || has(page)) continue;
    try {
      take_page(page, bytes.subspan(at, length));
    } catch (const FormatError&) {
      // Nobody asked for this page: load() refuses it when somebody does.
    }
  }
}

/// Verifies and decodes a page.
void PartialReader::take_page(std::uint32_t page, std::span<const std::byte> image) {
  const DirectoryEntry& entry = entries_.at(page);
  in_source(source_, entry.offset, [&] {
    std::optional<std::uint32_t> rank;
    if (!numbers_.others().contains(page)) rank = rank_of(numbers_, {}, page);
    const PageHeader found = decode_agreed_header(image, header(), entry, rank);
    check_payload(image, found);
    Loaded loaded{std::vector<std::byte>(found.raw_bytes), found.record_count};
    decode_payload(found, image.subspan(kPageHeaderBytes),
                   {.point_bytes = header().point_bytes,
                    .node_pages = {},
                    .points = superblock_.points,
                    .columns = &columns_},
                   loaded.payload, decoder_);
    if (found.type == PageType::node) {
      try {
        // Where a scene has parts, references may lead into them.
        const std::uint32_t pages = header().has_parts() ? kNoPage : superblock_.node_pages;
        static_cast<void>(NodePage(loaded.payload, found.record_count, pages, superblock_.points,
                                   header().point_bytes != kPointBytes));
      } catch (const FormatError& error) {
        throw placed_in_page(error, found);
      }
    }
    pages_.emplace(page, std::move(loaded));
  });
}

NodePage PartialReader::nodes(std::uint32_t rank) const {
  const Loaded& page = pages_.at(numbers_.nodes()[rank]);
  return {page.payload.data(), page.record_count};
}

PointPage PartialReader::points(std::uint32_t rank) const {
  const Loaded& page = pages_.at(numbers_.points()[rank]);
  return {page.payload.data(), page.record_count, header().point_bytes};
}

std::span<const std::byte> PartialReader::payload(std::uint32_t page) const {
  return pages_.at(page).payload;
}

}  // namespace ptc
