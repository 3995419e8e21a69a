// Checks across directory entries, in the order of spec/container.md#opening: each entry alone was
// checked when it was decoded.
#include "engine/store/structure.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "engine/store/clauses.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kTail[] = "spec/container.md#tail-pages";
constexpr char kOverlap[] = "spec/container.md#directory-overlap";
constexpr char kMeta[] = "spec/container.md#meta-page";
constexpr char kRoot[] = "spec/container.md#superblock-root";
constexpr char kDigest[] = "spec/container.md#superblock-digest";
constexpr char kPointPages[] = "spec/points.md#point-pages";

/// Throws errors with the place in the file of the entry or superblock at fault.
class Blame {
 public:
  explicit Blame(const Superblock& superblock) : superblock_(superblock) {}

  [[noreturn]] void entry(std::uint32_t page, const char* clause, const std::string& text) const {
    throw FormatError(entry_offset(superblock_, page), clause,
                      "page " + std::to_string(page) + " " + text);
  }
  [[noreturn]] void superblock(const char* clause, const std::string& text) const {
    throw FormatError(superblock_.file_bytes - 2 * kBlockBytes, clause, text);
  }

 private:
  const Superblock& superblock_;
};

/// Returns the pages of a superblock's counts; the groups are not needed for their places.
PageNumbers places_of(const Superblock& superblock) {
  return {superblock, {}};
}

std::uint64_t count_records(std::span<const DirectoryEntry> entries,
                            const PageNumbers::Range& pages) {
  // No overflow: fewer than 2^32 pages of less than 2^32 records.
  return std::accumulate(
      pages.begin(), pages.end(), std::uint64_t{0},
      [&](std::uint64_t sum, std::uint32_t page) { return sum + entries[page].record_count; });
}

/// Each page has the type and group of its place. Attribute pages of a group stand together, and
/// groups ascend.
void verify_listing(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                    const Blame& blame) {
  const PageNumbers places = places_of(superblock);
  for (std::uint32_t page = 0; page < entries.size(); ++page) {
    const DirectoryEntry& entry = entries[page];
    PageType wanted = PageType::attribute;
    std::uint8_t least = 0;
    if (places.points().contains(page)) {
      wanted = PageType::point;
    } else if (places.nodes().contains(page)) {
      wanted = PageType::node;
    } else if (page >= places.others().first) {
      if (page == places.meta()) continue;  // verify_meta_page() looks at it
      const bool parts = entry.type == PageType::parts && superblock.header.has_parts();
      const bool ordered = page == places.others().first || entries[page - 1].type <= entry.type;
      if ((parts || is_skippable(entry.type)) && ordered) continue;
      blame.entry(page, clause::kDirectoryListing, "has no place behind the node pages");
    } else if (page % superblock.point_pages != 0) {
      least = entries[page - 1].group;  // the group of the page before it
      if (entry.group != least)
        blame.entry(page, clause::kDirectoryListing, "is of another group than its place");
    } else if (page > superblock.point_pages && entry.group <= entries[page - 1].group) {
      blame.entry(page, clause::kDirectoryListing, "begins a group that does not ascend");
    }
    if (entry.type != wanted)
      blame.entry(page, clause::kDirectoryListing, "is of another type than its place");
  }
}

/// Each page lies between header and superblocks: that much its entry alone has shown. Pages of the
/// tail lie behind the directory, one after another: that the superblock's decoder has shown.
void verify_extents(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                    const Blame& blame) {
  const auto body = entries.first(entries.size() - superblock.tail.size());
  std::vector<std::uint32_t> order;
  order.reserve(body.size());
  for (std::uint32_t page = 0; page < body.size(); ++page) {
    if (!body[page].is_void()) order.push_back(page);
  }
  std::ranges::sort(order, {}, [&](std::uint32_t page) { return body[page].offset; });
  std::uint64_t free_from = kBlockBytes;
  for (const std::uint32_t page : order) {
    const DirectoryEntry& entry = body[page];
    if (entry.offset < free_from) blame.entry(page, kOverlap, "overlaps another page");
    free_from = entry.offset + extent_bytes(entry.stored_bytes);
    if (free_from > superblock.directory_offset) {
      blame.entry(page, kOverlap, "overlaps the directory");
    }
  }
}

/// The superblock repeats the last entries.
void verify_tail(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                 const Blame& blame) {
  if (!std::ranges::equal(entries.last(superblock.tail.size()), superblock.tail)) {
    blame.superblock(kTail, "the tail that it lists is not the end of the directory");
  }
}

void verify_meta_page(std::span<const DirectoryEntry> entries, const Blame& blame) {
  for (std::uint32_t page = 0; page < entries.size(); ++page) {
    const bool last = page + 1 == entries.size();
    if ((entries[page].type == PageType::meta) == last) continue;
    blame.entry(page, kMeta, last ? "is the last one, and no meta page" : "is a second meta page");
  }
}

void verify_counts(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                   const Blame& blame) {
  const auto same = [&](const char* what, std::uint64_t said, std::uint64_t found) {
    if (said == found) return;
    blame.superblock(clause::kSuperblockCounts, "superblock says " + std::to_string(said) + " " +
                                                    what + ", the directory has " +
                                                    std::to_string(found));
  };
  const PageNumbers places = places_of(superblock);
  // Points and groups of a scene of parts are compared once its parts are open.
  if (!superblock.header.has_parts()) {
    same("points", superblock.points, count_records(entries, places.points()));
    same("node groups", superblock.node_groups, count_records(entries, places.nodes()));
  }
  if (superblock.nodes > superblock.node_groups * kMaxChildren) {
    blame.superblock(clause::kSuperblockCounts,
                     "superblock says " + std::to_string(superblock.nodes) + " nodes in " +
                         std::to_string(superblock.node_groups) + " groups");
  }
}

void verify_root(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                 const Blame& blame) {
  if (superblock.points == 0) return;
  const DirectoryEntry& root = entries[places_of(superblock).nodes()[superblock.root_page]];
  if (superblock.root_slot >= root.record_count) {
    blame.superblock(kRoot, "the root group it names is in no node page");
  }
}

void verify_digest(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                   const Blame& blame) {
  if (content_digest(entries) != superblock.content_xxh3) {
    blame.superblock(kDigest, "content digest is not that of the directory");
  }
}

/// The page and place of a point follow from its number.
void verify_point_pages(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                        const Blame& blame) {
  const std::uint32_t full = points_per_page(superblock.header);
  for (std::uint32_t page = 0; page < superblock.point_pages; ++page) {
    const std::uint32_t count = entries[page].record_count;
    if (count == full || (count < full && page + 1 == superblock.point_pages)) continue;
    blame.entry(page, kPointPages,
                "holds " + std::to_string(count) + " points instead of " + std::to_string(full));
  }
}

void verify_group(std::span<const DirectoryEntry> entries, const PageNumbers::Range& pages,
                  std::size_t point_bytes, const Blame& blame) {
  for (std::uint32_t rank = 0; rank < pages.count; ++rank) {
    const DirectoryEntry& entry = entries[pages[rank]];
    const std::uint32_t count = entries[rank].record_count;
    if (entry.record_count != count) {
      blame.entry(pages[rank], clause::kAttributePages,
                  "has attributes of " + std::to_string(entry.record_count) +
                      " points, its point page has " + std::to_string(count));
    }
    if (!entry.is_void() && entry.raw_bytes != std::uint64_t{count} * point_bytes) {
      blame.entry(pages[rank], clause::kAttributePages, "is not as long as its channels are");
    }
  }
}

}  // namespace

std::uint64_t extent_bytes(std::uint32_t stored_bytes) noexcept {
  return round_up(kPageHeaderBytes + std::uint64_t{stored_bytes}, kSectorBytes);
}

std::uint64_t directory_page_offset(const Superblock& superblock, std::uint32_t index) noexcept {
  return superblock.directory_offset + (std::uint64_t{index} << superblock.header.page_shift);
}

std::uint64_t entry_offset(const Superblock& superblock, std::uint32_t page) noexcept {
  const std::uint32_t per_page = directory_entries_per_page(superblock.header);
  return directory_page_offset(superblock, page / per_page) + kPageHeaderBytes +
         std::uint64_t{page % per_page} * kDirectoryEntryBytes;
}

PageNumbers page_numbers(const Superblock& superblock, std::span<const DirectoryEntry> entries) {
  std::vector<std::uint8_t> groups;
  for (std::uint32_t j = 1; j <= superblock.attribute_groups && superblock.point_pages > 0; ++j)
    groups.push_back(entries[std::size_t{j} * superblock.point_pages].group);
  return {superblock, std::move(groups)};
}

std::uint32_t rank_of(const PageNumbers& numbers, std::span<const DirectoryEntry> entries,
                      std::uint32_t page) {
  const std::uint32_t points = numbers.points().count;
  if (page < numbers.nodes().first) return page % points;
  if (page < numbers.others().first) return page - numbers.nodes().first;
  if (page == numbers.meta()) return 0;
  // Pages between node pages and meta page stand by ascending type.
  const auto others = entries.subspan(numbers.others().first, numbers.others().count);
  const auto first =
      std::ranges::lower_bound(others, entries[page].type, {}, &DirectoryEntry::type);
  return page - numbers.others().first - static_cast<std::uint32_t>(first - others.begin());
}

void verify_pages(const Superblock& superblock, std::span<const DirectoryEntry> entries) {
  const Blame blame(superblock);
  verify_listing(superblock, entries, blame);
  verify_extents(superblock, entries, blame);
  verify_meta_page(entries, blame);
  verify_tail(superblock, entries, blame);
  verify_counts(superblock, entries, blame);
  verify_root(superblock, entries, blame);
  verify_digest(superblock, entries, blame);
  verify_point_pages(superblock, entries, blame);
}

void verify_attributes(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                       const Meta& meta) {
  const Blame blame(superblock);
  const std::vector<std::uint8_t> groups = channel_groups(meta.channels);
  if (groups.size() != superblock.attribute_groups) {
    blame.superblock(clause::kAttributePages,
                     "the superblock counts " + std::to_string(superblock.attribute_groups) +
                         " channel groups, the meta page has " + std::to_string(groups.size()));
  }
  const PageNumbers numbers(superblock, groups);
  for (const std::uint8_t group : groups) {
    const PageNumbers::Range pages = numbers.attributes(group);
    if (!pages.empty() && entries[pages.first].group != group) {
      blame.entry(pages.first, clause::kAttributePages,
                  "is of channel group " + std::to_string(entries[pages.first].group) +
                      " where the meta page has " + std::to_string(group));
    }
    verify_group(entries, pages, group_point_bytes(meta.channels, group), blame);
  }
}

}  // namespace ptc
