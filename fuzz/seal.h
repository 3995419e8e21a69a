// Repairs the checksums of a container that was changed, so that readers refuse it by the rules of
// the format and not by its checksums.
//
//   payloads --> page headers --> directory --> content digest, tail --> superblocks
//
// Each checksum covers the ones before it, so the order matters. The file's own numbers lead from
// structure to structure; a number that leads outside the file is ignored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ptc::fuzz {

/// The places of a container's structures, as far as its own numbers lead to places inside it. All
/// places are offsets from the start of the file, in bytes.
struct Layout {
  /// A page that the directory lists and that lies in the file.
  struct Page {
    std::size_t entry = 0;         ///< its directory entry
    std::size_t header = 0;        ///< its header, which the payload follows
    std::size_t stored_bytes = 0;  ///< length of its payload
  };
  /// A page of the directory.
  struct DirectoryPage {
    std::size_t header = 0;  ///< its header, which the entries follow
    std::size_t bytes = 0;   ///< length of its entries
  };
  std::size_t superblock = 0;        ///< the first superblock
  std::vector<std::size_t> entries;  ///< all directory entries, those of void pages among them
  std::vector<Page> pages;  ///< only pages whose header and payload lie behind the file header
  std::vector<DirectoryPage> directory;
  std::size_t tail_entries = 0;  ///< entries that each superblock repeats, at most 64
};

inline constexpr std::size_t kEntryBytes = 40;      ///< length of a directory entry
inline constexpr std::size_t kTailEntriesAt = 512;  ///< where a superblock repeats the last entries

/// Finds the structures of a container, which may be damaged in any way.
/// @param file  at least kMinFile bytes
[[nodiscard]] Layout find_layout(std::span<const std::byte> file);
/// The length of a header block and two superblocks, bytes.
inline constexpr std::size_t kMinFile = 3 * 4096;

/// The parts that seal() repairs, in this order; the copies precede the checksums of the
/// superblocks.
enum Seals : unsigned {
  kSealFileHeader = 1,   ///< checksum of the file header
  kSealPayloads = 2,     ///< payload hashes in page headers and entries
  kSealPageHeaders = 4,  ///< checksums of page headers
  kSealDirectory = 8,    ///< payload hashes of directory pages, and the hash of all entries
  kSealDigest = 16,      ///< content digest
  kSealSuperblock = 32,  ///< checksums of both superblocks
  kSealCopies = 64,      ///< copy of the file header in the first superblock, and the second one
  kSealTail = 128,       ///< copies of the last directory entries in the first superblock
  kSealAll = 255
};

/// Gives the structures of a container the checksums of their content. A file of fewer than
/// kMinFile bytes stays as it is.
/// @param seals  a sum of Seals
void seal(std::span<std::byte> file, unsigned seals = kSealAll);

}  // namespace ptc::fuzz
