// Checksums of a container put right, so that its rules are what a reader refuses it by.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ptc::fuzz {

/// Where the structures of a container lie, as far as its own numbers lead to places inside it.
struct Layout {
  struct Page {
    std::size_t entry = 0;   ///< its directory entry
    std::size_t header = 0;  ///< its payload follows
    std::size_t stored_bytes = 0;
  };
  struct DirectoryPage {
    std::size_t header = 0;
    std::size_t bytes = 0;  ///< of entries
  };
  std::size_t superblock = 0;  ///< the first copy
  std::vector<Page> pages;     ///< without those whose header and payload do not lie in the file
  std::vector<DirectoryPage> directory;
};

/// @param file  at least kMinFile bytes
[[nodiscard]] Layout find_layout(std::span<const std::byte> file);
inline constexpr std::size_t kMinFile = 3 * 4096;

/// What seal() repairs, in this order.
enum Seals : unsigned {
  kSealFileHeader = 1,
  kSealPayloads = 2,  ///< in page headers and entries
  kSealPageHeaders = 4,
  kSealDirectory = 8,  ///< payload hashes of its pages, and of all entries
  kSealDigest = 16,
  kSealSuperblock = 32,  ///< both copies
  kSealCopies = 64,      ///< before: the second becomes the first, which repeats the file header
  kSealAll = 127
};

/// Gives the structures of a container the checksums of what they hold.
void seal(std::span<std::byte> file, unsigned seals = kSealAll);

}  // namespace ptc::fuzz
