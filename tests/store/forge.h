// Containers with one lie in them and every checksum correct, so that only a structural check can
// find it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "format/container.h"

namespace ptc::test {

/// A container taken apart. After changes, bytes() seals it again: page headers, directory, content
/// digest and superblocks get the checksums of what they hold.
struct Forgery {
  struct Page {
    std::uint64_t offset = 0;  ///< where bytes() puts the page, whatever its entry says
    PageHeader header;         ///< gets the hash of `stored`, unless rehash_payloads is false
    std::vector<std::byte> stored;
  };
  FileHeader header;
  Superblock superblock;
  std::vector<DirectoryEntry> entries;
  std::vector<Page> pages;            ///< by page number
  std::vector<PageHeader> directory;  ///< headers of the directory's pages
  bool rehash_payloads = true;        ///< header and entry take the hash of `stored`
  bool rehash_directory_pages =
      true;                      ///< headers of directory pages take the hash of their entries
  bool rehash_directory = true;  ///< superblock takes hash, digest and tail from the entries
  /// Changes both superblocks before they are sealed; may be empty.
  std::function<void(Superblock& first, Superblock& second)> last_word;

  explicit Forgery(const std::filesystem::path& path);
  [[nodiscard]] std::vector<std::byte> bytes() const;
};

}  // namespace ptc::test
