// The entries of a container that is being written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <vector>

#include "engine/io/file/file.h"
#include "format/container.h"

namespace ptc {

/// The directory of a container that grows. Pages of each type and channel group are counted before
/// they are written, and lie in any order in the file; their entries are kept on the disk, encoded.
///
/// Threads: all functions may be called concurrently.   Memory: one bit for each page.
class EntryTable {
 public:
  /// Begins an empty table.
  /// @param directory  gets a nameless file for each type and group, of 40 bytes for each page
  explicit EntryTable(std::filesystem::path directory) : directory_(std::move(directory)) {}

  /// Adds pages of a type and group that have no entry yet.
  /// @return  the rank of the first one
  /// @throws RequestError when the container would have more than kMaxPages pages;
  /// std::system_error
  std::uint32_t add(PageType type, std::uint8_t group, std::uint32_t pages);
  /// Returns the number of pages of a type and group.
  [[nodiscard]] std::uint32_t size(PageType type, std::uint8_t group = 0) const;
  /// Returns the number of all pages.
  [[nodiscard]] std::uint32_t size() const;
  /// Says whether a page was added and set() not called for it.
  [[nodiscard]] bool awaits(PageType type, std::uint8_t group, std::uint32_t rank) const;
  /// Says whether set() was called for every page.
  [[nodiscard]] bool complete() const;
  /// Sets the entry of the page of this rank among those of its type and group.
  /// @pre awaits()
  /// @throws std::system_error
  void set(std::uint32_t rank, const DirectoryEntry& entry);
  /// Returns the encoded entries of all pages, in the order of the directory.
  /// @pre complete()
  /// @throws std::system_error
  [[nodiscard]] std::vector<std::byte> encoded() const;

 private:
  /// The pages of one type and group.
  struct Kind {
    explicit Kind(const std::filesystem::path& directory) : file(directory) {}
    std::vector<bool> has;
    TempFile file;
  };
  [[nodiscard]] const Kind* find(PageType type, std::uint8_t group) const;

  mutable std::mutex mutex_;
  std::filesystem::path directory_;
  std::map<unsigned, Kind> kinds_;  ///< in the order of the directory
  std::uint64_t pages_ = 0;
};

}  // namespace ptc
