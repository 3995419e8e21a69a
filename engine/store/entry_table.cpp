#include "engine/store/entry_table.h"

#include <algorithm>
#include <array>

#include "engine/base/error.h"

namespace ptc {
namespace {

// Returns the place of a type and group in the directory: points, attributes by ascending group,
// nodes, and then other types by ascending number (spec/container.md#pages). The meta page is last.
unsigned order_of(PageType type, std::uint8_t group) {
  constexpr unsigned kOthers = 256;
  if (type == PageType::point) return 0;
  if (type == PageType::attribute) return group;
  if (type == PageType::meta) return 2 * kOthers;
  return type == PageType::node ? kOthers : kOthers + static_cast<unsigned>(type);
}

}  // namespace

const EntryTable::Kind* EntryTable::find(PageType type, std::uint8_t group) const {
  const auto found = kinds_.find(order_of(type, group));
  return found == kinds_.end() ? nullptr : &found->second;
}

std::uint32_t EntryTable::add(PageType type, std::uint8_t group, std::uint32_t pages) {
  const std::lock_guard lock(mutex_);
  if (pages > kMaxPages - pages_)
    throw RequestError("page_shift",
                       "more pages than a container can have: take larger ones, by "
                       "`page_shift`");
  Kind& kind = kinds_.try_emplace(order_of(type, group), directory_).first->second;
  const auto first = static_cast<std::uint32_t>(kind.has.size());
  kind.has.resize(first + std::size_t{pages});
  pages_ += pages;
  return first;
}

std::uint32_t EntryTable::size(PageType type, std::uint8_t group) const {
  const std::lock_guard lock(mutex_);
  const Kind* const kind = find(type, group);
  return kind == nullptr ? 0 : static_cast<std::uint32_t>(kind->has.size());
}

std::uint32_t EntryTable::size() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::uint32_t>(pages_);
}

bool EntryTable::awaits(PageType type, std::uint8_t group, std::uint32_t rank) const {
  const std::lock_guard lock(mutex_);
  const Kind* const kind = find(type, group);
  return kind != nullptr && rank < kind->has.size() && !kind->has[rank];
}

bool EntryTable::complete() const {
  const std::lock_guard lock(mutex_);
  return std::ranges::all_of(kinds_, [](const auto& kind) {
    return std::ranges::find(kind.second.has, false) == kind.second.has.end();
  });
}

void EntryTable::set(std::uint32_t rank, const DirectoryEntry& entry) {
  std::array<std::byte, kDirectoryEntryBytes> bytes;
  encode_directory_entry(entry, bytes);
  const std::lock_guard lock(mutex_);
  Kind& kind = kinds_.at(order_of(entry.type, entry.group));
  kind.has.at(rank) = true;
  kind.file.write_at(std::uint64_t{rank} * kDirectoryEntryBytes, bytes);
}

std::vector<std::byte> EntryTable::encoded() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::byte> all(pages_ * kDirectoryEntryBytes);
  std::span<std::byte> rest = all;
  for (const auto& [order, kind] : kinds_) {
    const std::size_t bytes = kind.has.size() * kDirectoryEntryBytes;
    kind.file.read_at(0, rest.first(bytes));
    rest = rest.subspan(bytes);
  }
  return all;
}

}  // namespace ptc
