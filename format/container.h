// The structures around the pages: header, page header, directory entry, superblock
// (spec/container.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "format/morton.h"

namespace ptc {

inline constexpr std::size_t kBlockBytes =
    4096;  ///< header, superblocks; the directory starts on it
inline constexpr std::size_t kSectorBytes = 512;  ///< pages start on it
/// @param unit  kSectorBytes for pages, kBlockBytes for the directory
[[nodiscard]] constexpr std::uint64_t round_up(std::uint64_t bytes, std::uint64_t unit) noexcept {
  return (bytes + unit - 1) / unit * unit;
}
inline constexpr std::size_t kPageHeaderBytes = 64;
inline constexpr std::uint32_t kPageMagic = 0x70435450;  ///< "PTCp", the first bytes of a page
inline constexpr std::size_t kDirectoryEntryBytes = 32;
inline constexpr std::uint32_t kNoPage = 0xffffffff;
inline constexpr std::uint64_t kMaxPages = 0xfffffffe;

enum class PageType : std::uint16_t { node = 1, point = 2, directory = 3, meta = 4, attribute = 5 };
enum class Codec : std::uint8_t { raw = 0, zstd = 1, lz4 = 2 };
enum class Filter : std::uint8_t { none = 0, columns = 1 };

/// How a payload lies in the file: filtered first, then compressed.
struct Coding {
  Codec codec = Codec::raw;
  Filter filter = Filter::none;
  friend bool operator==(const Coding&, const Coding&) = default;
};

using Uuid = std::array<std::byte, 16>;
/// One that follows from what `text` says.
[[nodiscard]] Uuid uuid_of(std::span<const std::byte> text) noexcept;

/// Bytes 0 to 4095 of a file: who it is. Written once, before anything else.
struct FileHeader {
  std::uint16_t major = 1;
  std::uint16_t minor = 0;
  std::uint64_t feature_incompat = 0;   ///< an unknown bit: refuse to open
  std::uint64_t feature_ro_compat = 0;  ///< an unknown bit: read, but do not copy or repair
  std::uint64_t feature_compat = 0;     ///< an unknown bit: ignore
  Uuid uuid{};                          ///< salts every page header's checksum
  std::uint8_t page_shift = 16;         ///< page size is 2^page_shift bytes, 12 to 20
  Frame frame;
};

/// 64 bytes in front of every page's payload.
struct PageHeader {
  PageType type = PageType::node;
  Coding coding;
  std::uint32_t page_id = 0;
  std::uint32_t stored_bytes = 0;  ///< payload as it lies in the file
  std::uint32_t raw_bytes = 0;     ///< payload decoded, at most page size - 64
  std::uint16_t group = 0;         ///< attribute pages: which channel group; else 0
  std::uint16_t level = 0;         ///< node pages: least level of its groups; else 0xffff
  std::uint32_t record_count = 0;  ///< points, node groups, entries or 1
  std::uint64_t first_key = 0;     ///< least high half of its points' keys or groups' cells
  std::uint64_t last_key = 0;      ///< greatest
  std::uint64_t payload_xxh3 = 0;  ///< XXH3-64 of the stored payload
};

/// Where a page lies. The n-th entry of the directory is page n.
struct DirectoryEntry {
  std::uint64_t offset = 0;  ///< of the page header, bytes from the start of the file
  std::uint32_t stored_bytes = 0;
  std::uint32_t raw_bytes = 0;
  std::uint64_t payload_xxh3 = 0;
  PageType type = PageType::node;
  std::uint16_t group = 0;
  std::uint32_t record_count = 0;
  friend bool operator==(const DirectoryEntry&, const DirectoryEntry&) = default;
};

/// What the directory says of a page with this header.
[[nodiscard]] inline DirectoryEntry entry_of(const PageHeader& page,
                                             std::uint64_t offset) noexcept {
  return {offset,    page.stored_bytes, page.raw_bytes,   page.payload_xxh3,
          page.type, page.group,        page.record_count};
}

/// The commit record, twice at the end of the file: a file without one is unfinished.
struct Superblock {
  FileHeader header;             ///< repeated, must equal bytes 0 to 119
  std::uint64_t file_bytes = 0;  ///< must equal the file's length
  std::uint32_t page_count = 0;
  std::uint32_t directory_pages = 0;
  std::uint64_t directory_offset = 0;
  std::uint64_t directory_xxh3 = 0;  ///< XXH3-64 of all entries, concatenated
  std::uint32_t meta_page = kNoPage;
  std::uint32_t root_page = kNoPage;  ///< root group; kNoPage when there are no points
  std::uint16_t root_slot = 0;
  std::uint16_t levels = 0;           ///< greatest group level + 1; 0 when there are no nodes
  std::uint32_t leaf_points = 0;      ///< a cell with no more points is not split
  std::uint32_t points_per_page = 0;  ///< every point page but the last holds so many
  std::uint64_t points = 0;
  std::uint64_t nodes = 0;  ///< children of all groups, the root not counted
  std::uint64_t node_groups = 0;
  std::array<double, 3> bounds_low{};  ///< of the points' positions, discs not counted
  std::array<double, 3> bounds_high{};
  double area = 0;               ///< sum of 2 r^2
  std::array<double, 3> flux{};  ///< sum of 2 r^2 times radiance
  /// XXH3-128 over (type, group, count, payload hash) of every page: {low, high}.
  std::array<std::uint64_t, 2> content_xxh3{};
  std::string writer;  ///< at most 63 bytes of UTF-8
};

using Block = std::array<std::byte, kBlockBytes>;

/// The first block of a file. Features and version are written as given.
[[nodiscard]] Block encode_file_header(const FileHeader& header);
/// @param bytes  the first 4096 bytes, or fewer when the file is shorter
/// @throws FormatError for a wrong magic, checksum, version, limit or unknown incompatible feature
[[nodiscard]] FileHeader decode_file_header(std::span<const std::byte> bytes);
/// The file header as a superblock repeats it, for files that lost theirs.
/// @param superblock  at least 120 bytes, its checksum right
/// @throws FormatError as decode_file_header()
[[nodiscard]] FileHeader decode_repeated_header(std::span<const std::byte> superblock);

/// Writes the header whose checksum holds for this file, number and type only.
void encode_page_header(const PageHeader& header, const Uuid& uuid,
                        std::span<std::byte, kPageHeaderBytes> out);
/// @param bytes  at least kPageHeaderBytes
/// @throws FormatError when magic, checksum (under this uuid), type, codec or a limit is wrong.
///         That page_id is the number it should be is left to the caller
[[nodiscard]] PageHeader decode_page_header(std::span<const std::byte> bytes,
                                            const FileHeader& file);

/// Writes an entry.
void encode_directory_entry(const DirectoryEntry& entry,
                            std::span<std::byte, kDirectoryEntryBytes> out) noexcept;
/// @param bytes       at least kDirectoryEntryBytes
/// @param file_bytes  length of the file: the page must lie between its header and superblocks
/// @throws FormatError when a field breaks a rule that it can break alone
[[nodiscard]] DirectoryEntry decode_directory_entry(std::span<const std::byte> bytes,
                                                    const FileHeader& file,
                                                    std::uint64_t file_bytes);

/// Most entries that one directory page holds.
[[nodiscard]] std::uint32_t directory_entries_per_page(const FileHeader& file) noexcept;
/// Bytes that the directory of so many pages takes in the file, headers and padding included.
[[nodiscard]] std::uint64_t directory_bytes(const FileHeader& file,
                                            std::uint32_t page_count) noexcept;

/// The last blocks of a file. @throws std::invalid_argument when `writer` is too long or no UTF-8
[[nodiscard]] Block encode_superblock(const Superblock& superblock);
/// @param file        the decoded first block, which the superblock must repeat
/// @param file_bytes  the file's actual length
/// @throws FormatError when magic or checksum is wrong, when it belongs to another file or length,
///         or when its numbers contradict each other
[[nodiscard]] Superblock decode_superblock(std::span<const std::byte> bytes, const FileHeader& file,
                                           std::uint64_t file_bytes);

/// Content digest: independent of the uuid and of where pages lie (spec/checksums.md#digest).
class ContentDigest {
 public:
  ContentDigest();
  ~ContentDigest();
  ContentDigest(ContentDigest&&) noexcept;
  ContentDigest& operator=(ContentDigest&&) noexcept;
  void add(const DirectoryEntry& entry);  ///< in page order
  /// {low, high} halves for the pages added so far.
  [[nodiscard]] std::array<std::uint64_t, 2> value() const;

 private:
  void* state_;
};

/// That of all pages. @param pages  in page order
[[nodiscard]] std::array<std::uint64_t, 2> content_digest(std::span<const DirectoryEntry> pages);

}  // namespace ptc
