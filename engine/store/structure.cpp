// Checks across directory entries, in the order of spec/container.md#opening: each entry alone was
// checked when it was decoded.
#include "engine/store/structure.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <string>

#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kOverlap[] = "spec/container.md#directory-overlap";
constexpr char kMeta[] = "spec/container.md#meta-page";
constexpr char kRoot[] = "spec/container.md#superblock-root";
constexpr char kCounts[] = "spec/container.md#superblock-counts";
constexpr char kDigest[] = "spec/container.md#superblock-digest";
constexpr char kPointPages[] = "spec/points.md#point-pages";
constexpr char kAttributePages[] = "spec/points.md#attribute-pages";

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

std::uint64_t count_records(std::span<const DirectoryEntry> entries,
                            std::span<const std::uint32_t> pages) {
  // No overflow: fewer than 2^32 pages of less than 2^32 records.
  return std::accumulate(
      pages.begin(), pages.end(), std::uint64_t{0},
      [&](std::uint64_t sum, std::uint32_t page) { return sum + entries[page].record_count; });
}

/// Each page lies between header and superblocks: that much its entry alone has shown.
void verify_extents(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                    const Blame& blame) {
  std::vector<std::uint32_t> order(entries.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::sort(order, {}, [&](std::uint32_t page) { return entries[page].offset; });
  std::uint64_t free_from = kBlockBytes;
  for (const std::uint32_t page : order) {
    const DirectoryEntry& entry = entries[page];
    if (entry.offset < free_from) blame.entry(page, kOverlap, "overlaps another page");
    free_from = entry.offset + extent_bytes(entry.stored_bytes);
    if (free_from > superblock.directory_offset) {
      blame.entry(page, kOverlap, "overlaps the directory");
    }
  }
}

void verify_meta_page(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                      const Blame& blame) {
  if (entries[superblock.meta_page].type != PageType::meta) {
    blame.superblock(kMeta, "the meta page it names is none");
  }
  for (std::uint32_t page = 0; page < entries.size(); ++page) {
    if (entries[page].type == PageType::meta && page != superblock.meta_page) {
      blame.entry(page, kMeta, "is a second meta page");
    }
  }
}

void verify_counts(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                   const PageIndex& index, const Blame& blame) {
  const auto same = [&](const char* what, std::uint64_t said, std::uint64_t found) {
    if (said == found) return;
    blame.superblock(kCounts, "superblock says " + std::to_string(said) + " " + what +
                                  ", the directory has " + std::to_string(found));
  };
  same("points", superblock.points, count_records(entries, index.points));
  same("node groups", superblock.node_groups, count_records(entries, index.nodes));
  if (superblock.nodes > superblock.node_groups * kMaxChildren) {
    blame.superblock(kCounts, "superblock says " + std::to_string(superblock.nodes) + " nodes in " +
                                  std::to_string(superblock.node_groups) + " groups");
  }
}

void verify_root(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                 const Blame& blame) {
  if (superblock.points == 0) return;
  const DirectoryEntry& root = entries[superblock.root_page];
  if (root.type != PageType::node || superblock.root_slot >= root.record_count) {
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
                        const PageIndex& index, const Blame& blame) {
  const std::uint32_t full = points_per_page(superblock.header);
  if (superblock.points != 0 && superblock.points_per_page != full) {
    blame.superblock(kPointPages, "superblock says " + std::to_string(superblock.points_per_page) +
                                      " points a page, pages of this size hold " +
                                      std::to_string(full));
  }
  for (const std::uint32_t page : index.points) {
    const std::uint32_t count = entries[page].record_count;
    if (count == full || (count < full && page == index.points.back())) continue;
    blame.entry(page, kPointPages,
                "holds " + std::to_string(count) + " points instead of " + std::to_string(full));
  }
}

void verify_group(std::span<const DirectoryEntry> entries, const PageIndex& index,
                  std::span<const std::uint32_t> pages, std::size_t point_bytes,
                  const Blame& blame) {
  for (std::size_t k = 0; k < pages.size(); ++k) {
    const DirectoryEntry& entry = entries[pages[k]];
    if (k >= index.points.size()) {
      blame.entry(pages[k], kAttributePages, "has attributes of no point page");
    }
    const std::uint32_t count = entries[index.points[k]].record_count;
    if (entry.record_count != count) {
      blame.entry(pages[k], kAttributePages,
                  "has attributes of " + std::to_string(entry.record_count) +
                      " points, its point page has " + std::to_string(count));
    }
    if (entry.raw_bytes != std::uint64_t{count} * point_bytes) {
      blame.entry(pages[k], kAttributePages, "is not as long as its channels are");
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

PageIndex index_pages(std::span<const DirectoryEntry> entries) {
  PageIndex index;
  const auto count = [&](PageType type) {
    return static_cast<std::size_t>(std::ranges::count(entries, type, &DirectoryEntry::type));
  };
  index.points.reserve(count(PageType::point));
  index.nodes.reserve(count(PageType::node));
  for (std::uint32_t page = 0; page < entries.size(); ++page) {
    const DirectoryEntry& entry = entries[page];
    if (entry.type == PageType::point) index.points.push_back(page);
    if (entry.type == PageType::node) index.nodes.push_back(page);
    if (entry.type == PageType::attribute) index.attributes[entry.group].push_back(page);
  }
  return index;
}

void verify_pages(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                  const PageIndex& index) {
  const Blame blame(superblock);
  verify_extents(superblock, entries, blame);
  verify_meta_page(superblock, entries, blame);
  verify_counts(superblock, entries, index, blame);
  verify_root(superblock, entries, blame);
  verify_digest(superblock, entries, blame);
  verify_point_pages(superblock, entries, index, blame);
}

void verify_attributes(const Superblock& superblock, std::span<const DirectoryEntry> entries,
                       const PageIndex& index, const Meta& meta) {
  const Blame blame(superblock);
  std::set<std::uint16_t> groups;
  for (const Channel& channel : meta.channels) groups.insert(channel.group);
  for (const auto& [group, pages] : index.attributes) {
    if (!groups.contains(group)) {
      blame.entry(
          pages.front(), kAttributePages,
          "is of channel group " + std::to_string(group) + ", which the meta page does not name");
    }
    verify_group(entries, index, pages, group_point_bytes(meta.channels, group), blame);
  }
  for (const std::uint16_t group : groups) {
    const auto found = index.attributes.find(group);
    const std::size_t count = found == index.attributes.end() ? 0 : found->second.size();
    if (count == index.points.size()) continue;
    blame.superblock(kAttributePages, "channel group " + std::to_string(group) + " has " +
                                          std::to_string(count) + " pages for " +
                                          std::to_string(index.points.size()) + " point pages");
  }
}

}  // namespace ptc
