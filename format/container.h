// The structures around the pages: file header, page header, directory entry and superblock
// (spec/container.md).
//
//   0        4096                directory_offset     tail_offset          file_bytes - 8192
//   | file   | page ... page ... | directory page ... | coarse pages, meta | superblock | the same
//   | | header |                   |                    | page               | A          | B |
//
// The file header identifies the file and is written first. Every page starts on a sector of 512
// bytes and opens with a page header of 64 bytes, so pages can be found without the directory. The
// directory says where each page lies. The two equal superblocks are the commit record: they are
// written last, and a file that has neither is unfinished.
//
// Pages of one type and channel group are counted from 0: a page's rank. Its number, the place of
// its entry in the directory, follows from type, group and rank (PageNumbers).
//
// Each structure has an encode function that writes a value as it lies in the file and a decode
// function that accepts untrusted bytes: it checks every rule that the bytes can break alone and
// throws FormatError with the offset of the broken field. Rules that join several structures belong
// to the reader of the file (engine/store).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "format/morton.h"

namespace ptc {

inline constexpr std::size_t kBlockBytes =
    4096;  ///< size of the file header and of each superblock; alignment of the directory
inline constexpr std::size_t kSectorBytes = 512;  ///< alignment of pages, bytes
/// Rounds a number of bytes up to a multiple of `unit`.
/// @param unit  kSectorBytes for pages, kBlockBytes for the directory
[[nodiscard]] constexpr std::uint64_t round_up(std::uint64_t bytes, std::uint64_t unit) noexcept {
  return (bytes + unit - 1) / unit * unit;
}
inline constexpr std::size_t kPageHeaderBytes = 64;      ///< in front of every page's payload
inline constexpr std::uint32_t kPageMagic = 0x70435450;  ///< "PTCp", the first bytes of a page
inline constexpr std::size_t kDirectoryEntryBytes = 40;
inline constexpr std::size_t kPartBytes = 384;  ///< record of a parts page
/// Returns the greatest number of payload bytes in a page of 2^page_shift bytes.
[[nodiscard]] constexpr std::uint32_t payload_limit(std::uint8_t page_shift) noexcept {
  return (std::uint32_t{1} << page_shift) - static_cast<std::uint32_t>(kPageHeaderBytes);
}
inline constexpr std::uint32_t kNoPage = 0xffffffff;    ///< number that no page has
inline constexpr std::uint64_t kMaxPages = 0xfffffffe;  ///< greatest number of pages in a file

inline constexpr std::uint8_t kNoLevel = 0xff;           ///< level of a page that has no groups
inline constexpr std::uint8_t kPointBytes = 34;          ///< of a point that emits no light
inline constexpr std::uint8_t kEmittingPointBytes = 40;  ///< of a point that may emit light
inline constexpr std::size_t kMaxTailPages = 64;         ///< entries that a superblock repeats
inline constexpr std::uint64_t kReleaseFeature = 1;      ///< bit of every file since version 1.0
inline constexpr std::uint64_t kPartsFeature = 2;        ///< bit of a scene of parts

/// The kind of payload that a page has; the values are those of the page header. Values from
/// kFirstSkippable on stand for pages of later versions, which readers pass over.
enum class PageType : std::uint8_t {
  node = 1,
  point = 2,
  directory = 3,
  meta = 4,
  attribute = 5,
  parts = 6
};
inline constexpr std::uint8_t kFirstSkippable = 128;
/// Returns whether readers pass over pages of a type.
[[nodiscard]] constexpr bool is_skippable(PageType type) noexcept {
  return static_cast<std::uint8_t>(type) >= kFirstSkippable;
}
/// The compression of a payload; the values are those of the page header.
enum class Codec : std::uint8_t { raw = 0, zstd = 1, lz4 = 2 };
/// The step that precedes the compression of a payload; the values are those of the page header.
enum class Filter : std::uint8_t { none = 0, columns = 1 };

/// The form in which a payload is stored in the file. Writers filter first and compress then.
struct Coding {
  Codec codec = Codec::raw;
  Filter filter = Filter::none;
  friend bool operator==(const Coding&, const Coding&) = default;
};

/// The identity of a file's content. Files of different content have different ones.
using Uuid = std::array<std::byte, 16>;
/// Returns a Uuid that depends on the bytes of `text` only: their XXH3-128.
[[nodiscard]] Uuid uuid_of(std::span<const std::byte> text) noexcept;

/// The file header, bytes 0 to 4095 of a file: its identity and what its pages rely on. It is
/// written once, before anything else.
struct FileHeader {
  std::uint16_t major = 1;
  std::uint16_t minor = 0;
  std::uint64_t feature_incompat = kReleaseFeature;  ///< readers refuse a file with an unknown bit
  std::uint64_t feature_ro_compat = 0;     ///< an unknown bit allows reading, but no copy or repair
  std::uint64_t feature_compat = 0;        ///< readers ignore unknown bits
  Uuid uuid{};                             ///< salts the checksum of every page header
  std::uint8_t page_shift = 16;            ///< page size is 2^page_shift bytes, 12 to 20
  std::uint8_t point_bytes = kPointBytes;  ///< or kEmittingPointBytes when points may emit light
  Frame frame;                             ///< the lattice on which all points lie

  /// Says whether the file is a scene of parts.
  [[nodiscard]] bool has_parts() const noexcept { return (feature_incompat & kPartsFeature) != 0; }
};

/// The page header: 64 bytes in front of every page's payload.
struct PageHeader {
  PageType type = PageType::node;
  std::uint8_t group = 0;  ///< channel group of an attribute page; else 0
  Coding coding;
  std::uint32_t rank = 0;          ///< number of pages of the same type and group before it
  std::uint32_t stored_bytes = 0;  ///< length of the payload in the file
  std::uint32_t raw_bytes = 0;     ///< length of the decoded payload, at most page size - 64
  std::uint8_t level = kNoLevel;   ///< least level of a node page's groups; else kNoLevel
  std::uint32_t record_count = 0;  ///< points, node groups or directory entries; 1 in a meta page
  std::uint64_t first_key = 0;     ///< least high half of the points' keys or groups' cells
  std::uint64_t last_key = 0;      ///< greatest high half of the points' keys or groups' cells
  std::uint64_t payload_xxh3 = 0;  ///< XXH3-64 of the stored payload
};

/// A directory entry: where a page lies, and the facts of its header. The n-th entry is page n.
struct DirectoryEntry {
  std::uint64_t offset = 0;        ///< bytes from the start of the file to the page header
  std::uint32_t stored_bytes = 0;  ///< length of the payload in the file
  std::uint32_t raw_bytes = 0;     ///< length of the decoded payload
  std::uint64_t payload_xxh3 = 0;  ///< XXH3-64 of the stored payload
  std::uint64_t first_key = 0;     ///< as PageHeader::first_key
  std::uint32_t record_count = 0;  ///< as PageHeader::record_count
  PageType type = PageType::node;
  std::uint8_t group = 0;         ///< channel group of an attribute page; else 0
  std::uint8_t level = kNoLevel;  ///< as PageHeader::level
  friend bool operator==(const DirectoryEntry&, const DirectoryEntry&) = default;

  /// Returns whether the page is not in the file: an attribute page without any known value.
  [[nodiscard]] bool is_void() const noexcept {
    return type == PageType::attribute && offset == 0 && stored_bytes == 0 && raw_bytes == 0 &&
           payload_xxh3 == 0;
  }
};

/// Returns the directory entry of a page that has this header and starts at `offset`.
[[nodiscard]] inline DirectoryEntry entry_of(const PageHeader& page,
                                             std::uint64_t offset) noexcept {
  return {offset,         page.stored_bytes, page.raw_bytes, page.payload_xxh3,
          page.first_key, page.record_count, page.type,      page.group,
          page.level};
}

/// The superblock: the commit record, which stands twice at the end of the file. A file without a
/// superblock is unfinished.
struct Superblock {
  FileHeader header;                   ///< copy of the file header; must equal its bytes 8 to 119
  std::uint64_t file_bytes = 0;        ///< must equal the length of the file
  std::uint32_t page_count = 0;        ///< pages in the directory; its own pages are not counted
  std::uint32_t directory_pages = 0;   ///< pages that the directory takes
  std::uint64_t directory_offset = 0;  ///< bytes from the start of the file to the directory
  std::uint64_t directory_xxh3 = 0;    ///< XXH3-64 of all entries, concatenated
  std::uint64_t tail_offset = 0;       ///< where the directory ends and the tail starts, bytes
  std::uint32_t point_pages = 0;
  std::uint32_t node_pages = 0;
  std::uint16_t attribute_groups = 0;  ///< channel groups, each with point_pages pages
  std::uint32_t root_page =
      kNoPage;                    ///< rank of the root group's node page; kNoPage without points
  std::uint16_t root_slot = 0;    ///< slot of the root group in that page
  std::uint16_t levels = 0;       ///< greatest level of a group + 1; 0 without nodes
  std::uint32_t leaf_points = 0;  ///< a cell with at most this many points is not split
  std::uint64_t points = 0;
  std::uint64_t nodes = 0;  ///< children of all groups; the root is not counted
  std::uint64_t node_groups = 0;
  std::array<double, 3> bounds_low{};   ///< low corner of the points' positions, without discs
  std::array<double, 3> bounds_high{};  ///< high corner of the points' positions, without discs
  double area = 0;                      ///< sum of 2 radius^2, scene units squared
  std::array<double, 3> flux{};         ///< sum of 2 radius^2 times radiance and emission, RGB
  /// The content digest: XXH3-128 over (type, group, count, payload hash) of every page: {low,
  /// high}.
  std::array<std::uint64_t, 2> content_xxh3{};
  std::string writer;  ///< name of the program that wrote the file, at most 63 bytes of UTF-8
  std::vector<DirectoryEntry> tail;  ///< entries of the last pages, 1 to kMaxTailPages
  std::uint64_t xxh3 = 0;  ///< checksum of the block that was decoded; encoders compute it
};

/// Converts between the number of a page and its type, group and rank
/// (spec/container.md#pages).
class PageNumbers {
 public:
  PageNumbers() = default;
  /// Takes the counts of a superblock, and the groups of its schema.
  /// @param groups  channel groups, ascending, Superblock::attribute_groups many
  PageNumbers(const Superblock& superblock, std::vector<std::uint8_t> groups);

  /// A run of pages of one kind: their numbers follow each other.
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
    [[nodiscard]] std::uint32_t operator[](std::size_t rank) const noexcept {
      return first + static_cast<std::uint32_t>(rank);
    }
    [[nodiscard]] std::size_t size() const noexcept { return count; }
    [[nodiscard]] bool empty() const noexcept { return count == 0; }
    [[nodiscard]] bool contains(std::uint32_t page) const noexcept { return page - first < count; }
    /// Returns the pages of ranks `begin` to `begin + number - 1`.
    [[nodiscard]] Range subrange(std::size_t begin, std::size_t number) const noexcept {
      return {first + static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(number)};
    }

    /// Walks the numbers of the pages, ascending.
    class Iterator {
     public:
      using iterator_category = std::forward_iterator_tag;
      using value_type = std::uint32_t;
      using difference_type = std::ptrdiff_t;
      using reference = std::uint32_t;
      using pointer = void;
      Iterator() = default;
      explicit Iterator(std::uint32_t page) noexcept : page_(page) {}
      [[nodiscard]] std::uint32_t operator*() const noexcept { return page_; }
      Iterator& operator++() noexcept {
        ++page_;
        return *this;
      }
      Iterator operator++(int) noexcept { return Iterator(page_++); }
      friend bool operator==(const Iterator&, const Iterator&) = default;

     private:
      std::uint32_t page_ = 0;
    };
    [[nodiscard]] Iterator begin() const noexcept { return Iterator(first); }
    [[nodiscard]] Iterator end() const noexcept { return Iterator(first + count); }
  };

  [[nodiscard]] Range points() const noexcept { return {0, points_}; }
  [[nodiscard]] Range nodes() const noexcept { return nodes_; }
  /// Returns the attribute pages of a group; none where the group does not exist.
  [[nodiscard]] Range attributes(std::uint8_t group) const noexcept;
  /// Returns the pages between the node pages and the meta page: of parts, and skippable ones.
  [[nodiscard]] Range others() const noexcept { return {nodes_.first + nodes_.count, others_}; }
  [[nodiscard]] std::uint32_t meta() const noexcept { return others().first + others_; }
  /// Returns the channel groups, ascending.
  [[nodiscard]] std::span<const std::uint8_t> groups() const noexcept { return groups_; }

 private:
  std::uint32_t points_ = 0;
  Range nodes_;
  std::uint32_t others_ = 0;
  std::vector<std::uint8_t> groups_;
};

/// A file header or superblock as it lies in the file.
using Block = std::array<std::byte, kBlockBytes>;

/// Encodes the first block of a file. Features and version are written as given.
[[nodiscard]] Block encode_file_header(const FileHeader& header);
/// Decodes and checks the first block of a file.
/// @param bytes  the first 4096 bytes, or fewer when the file is shorter
/// @throws FormatError for a wrong magic, checksum, version, limit or unknown incompatible feature
[[nodiscard]] FileHeader decode_file_header(std::span<const std::byte> bytes);
/// Refuses a file with an unknown bit in feature_ro_compat: its pages may be read, but not copied
/// into another file, appended to or repaired.
/// @throws FormatError naming the bits (spec/versions.md#features)
void check_copyable(const FileHeader& header);
/// Decodes the copy of the file header in a superblock, for files whose own header is lost.
/// @param superblock  at least 120 bytes of a superblock whose checksum is right
/// @throws FormatError as decode_file_header()
[[nodiscard]] FileHeader decode_repeated_header(std::span<const std::byte> superblock);

/// Encodes a page header. Its checksum is valid only in this file, for this type, group and rank.
/// @param uuid  FileHeader::uuid of the file
void encode_page_header(const PageHeader& header, const Uuid& uuid,
                        std::span<std::byte, kPageHeaderBytes> out);
/// Decodes and checks a page header. The caller checks that it is of the page that it expects.
/// @param bytes  at least kPageHeaderBytes
/// @throws FormatError when magic, checksum (under the uuid of `file`), type, codec or a limit is
///         wrong
[[nodiscard]] PageHeader decode_page_header(std::span<const std::byte> bytes,
                                            const FileHeader& file);

/// Encodes a directory entry.
void encode_directory_entry(const DirectoryEntry& entry,
                            std::span<std::byte, kDirectoryEntryBytes> out) noexcept;
/// Decodes a directory entry and checks it without regard to other entries.
/// @param bytes       at least kDirectoryEntryBytes
/// @param file_bytes  length of the file; the page must lie between its header and superblocks,
///                    unless it is void
/// @throws FormatError when a field is out of range or the page lies outside the file's pages
[[nodiscard]] DirectoryEntry decode_directory_entry(std::span<const std::byte> bytes,
                                                    const FileHeader& file,
                                                    std::uint64_t file_bytes);

/// Returns the number of entries in a full directory page.
[[nodiscard]] std::uint32_t directory_entries_per_page(const FileHeader& file) noexcept;
/// Returns the bytes that a directory of `page_count` entries takes in the file, including page
/// headers and padding.
[[nodiscard]] std::uint64_t directory_bytes(const FileHeader& file,
                                            std::uint32_t page_count) noexcept;

/// Encodes a superblock; the file ends in this block twice.
/// @throws std::invalid_argument when `writer` has more than 63 bytes or is not UTF-8
[[nodiscard]] Block encode_superblock(const Superblock& superblock);
/// Says whether a block of kBlockBytes is a whole superblock: it starts with the magic and its
/// checksum is right. It may break other rules.
[[nodiscard]] bool is_whole_superblock(std::span<const std::byte> bytes) noexcept;
/// Decodes and checks a superblock.
/// @param file        the decoded first block, which the superblock must repeat
/// @param file_bytes  the actual length of the file
/// @throws FormatError when magic or checksum is wrong, when the superblock belongs to another file
///         or to a file of another length, or when its numbers contradict each other
[[nodiscard]] Superblock decode_superblock(std::span<const std::byte> bytes, const FileHeader& file,
                                           std::uint64_t file_bytes);

/// Computes the content digest of a file (spec/checksums.md#digest), which depends neither on the
/// uuid nor on where the pages lie.
class ContentDigest {
 public:
  /// Starts a digest over no pages. @throws std::bad_alloc when there is no memory for its state
  ContentDigest();
  ~ContentDigest();
  ContentDigest(ContentDigest&&) noexcept;
  ContentDigest& operator=(ContentDigest&&) noexcept;
  /// Adds the next page. Pages are added by ascending number.
  void add(const DirectoryEntry& entry);
  /// Returns the digest of the pages that were added so far, as {low half, high half}.
  [[nodiscard]] std::array<std::uint64_t, 2> value() const;

 private:
  void* state_;  ///< XXH3_state_t; null once moved from
};

/// Returns the content digest of all pages of a file.
/// @param pages  entries by ascending page number
[[nodiscard]] std::array<std::uint64_t, 2> content_digest(std::span<const DirectoryEntry> pages);

}  // namespace ptc
