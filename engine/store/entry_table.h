// The entries of a container that is being written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <vector>

#include "engine/io/file/file.h"
#include "format/container.h"

namespace ptc {

/// A directory as it grows, kept on the disk as it will be written: pages are numbered before they
/// are, and lie in any order, so that what memory holds of a page until the end is one bit.
/// Threads: may be called concurrently.   Memory: a bit a page.
class EntryTable {
 public:
  /// @param directory  for a nameless file of 32 bytes a page. @throws std::system_error
  explicit EntryTable(const std::filesystem::path& directory) : file_(directory) {}

  /// Makes it longer by pages that have no entry yet.
  /// @return  number of the first. @throws RequestError when that would be more than kMaxPages
  std::uint32_t add(std::uint32_t pages);
  [[nodiscard]] std::uint32_t size() const;
  /// True when set() was called for the page. @throws std::out_of_range for a page that was not
  /// added
  [[nodiscard]] bool has(std::uint32_t page) const;
  /// True when set() was called for every page.
  [[nodiscard]] bool complete() const;
  /// @throws std::out_of_range for a page that was not added; std::system_error
  void set(std::uint32_t page, const DirectoryEntry& entry);
  /// The entries of all pages, encoded: every one must have been set. @throws std::system_error
  [[nodiscard]] std::vector<std::byte> encoded() const;

 private:
  mutable std::mutex mutex_;
  std::vector<bool> has_;
  TempFile file_;
};

}  // namespace ptc
