#include "engine/store/entry_table.h"

#include <algorithm>
#include <array>

#include "engine/base/error.h"

namespace ptc {

std::uint32_t EntryTable::add(std::uint32_t pages) {
  const std::lock_guard lock(mutex_);
  if (pages > kMaxPages - has_.size())
    throw RequestError("page_shift",
                       "more pages than a container can have: take larger ones, by "
                       "`page_shift`");
  const auto first = static_cast<std::uint32_t>(has_.size());
  has_.resize(has_.size() + pages);
  return first;
}

std::uint32_t EntryTable::size() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::uint32_t>(has_.size());
}

bool EntryTable::has(std::uint32_t page) const {
  const std::lock_guard lock(mutex_);
  return has_.at(page);
}

bool EntryTable::complete() const {
  const std::lock_guard lock(mutex_);
  return std::ranges::find(has_, false) == has_.end();
}

void EntryTable::set(std::uint32_t page, const DirectoryEntry& entry) {
  std::array<std::byte, kDirectoryEntryBytes> bytes;
  encode_directory_entry(entry, bytes);
  const std::lock_guard lock(mutex_);
  has_.at(page) = true;
  file_.write_at(std::uint64_t{page} * kDirectoryEntryBytes, bytes);
}

std::vector<std::byte> EntryTable::encoded() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::byte> all(has_.size() * kDirectoryEntryBytes);
  file_.read_at(0, all);
  return all;
}

}  // namespace ptc
