// Opens a container and reads its pages (spec/container.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/io/file/file.h"
#include "engine/store/page_content.h"
#include "engine/store/structure.h"
#include "format/codec.h"
#include "format/container.h"
#include "format/parts_page.h"
#include "format/schema.h"

namespace ptc {

/// A container that is open for reading.
///
/// Opening checks the header, the superblocks (the second copy serves when the first is damaged),
/// the directory, the meta page, and that the pages of the directory make up one scene. The
/// checksum of a page is checked each time the page is read. The padding between pages is not read.
///
///     const ContainerReader scene("city.ptcx");
///     std::vector<std::byte> payload(scene.page_payload_limit());
///     PageDecoder decoder;
///     for (const std::uint32_t page : scene.point_pages()) {
///       const PageHeader header = scene.read_page(page, payload, decoder);
///       use(PointPage(payload.data(), header.record_count));
///     }
///
/// Every function that reads throws FormatError, whose message begins with the path and whose
/// offset counts from the start of the file; an error in a page also names the page. A file that
/// has shrunk since it was opened is a DataError, and a failing system call a std::system_error. A
/// page number that does not exist is a std::invalid_argument.
///
/// A scene of parts (spec/parts.md) opens like any container, together with its parts, and looks
/// like one file: its pages are the point pages of all parts, their attribute pages, the scene's
/// own node pages and those of all parts, and the scene's other pages. superblock() has the counts
/// of these pages. References lead from page to page as in one file. Only the numbers of points
/// have gaps: each part begins on a page of its own, and the page of a point still follows from its
/// number.
///
/// Threads: all functions may be called concurrently.
/// Memory: kPageBytes for each page; up to kMaxPageBytes for each while it opens. Twice as much for
/// a scene of parts.
class ContainerReader {
 public:
  /// Whether the parts of a scene of parts are opened with it.
  enum class OpenParts : bool { no, yes };
  /// Opens a container. Without its parts, a scene of parts has only the pages of its own file.
  explicit ContainerReader(const std::filesystem::path& path, OpenParts parts = OpenParts::yes);
  ContainerReader(const ContainerReader&) = delete;
  ContainerReader& operator=(const ContainerReader&) = delete;

  static constexpr std::uint64_t kPageBytes = 40;      ///< memory of an open container, per page
  static constexpr std::uint64_t kMaxPageBytes = 120;  ///< memory while it opens, per page

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }
  /// The container's own file.
  [[nodiscard]] const InputFile& file() const noexcept { return file_; }
  /// The file of a part, as PageRange::part counts them.
  [[nodiscard]] const InputFile& file(std::uint32_t part) const noexcept {
    return part == 0 ? file_ : parts_[part - 1]->file_;
  }
  [[nodiscard]] const FileHeader& header() const noexcept { return header_; }
  [[nodiscard]] const Superblock& superblock() const noexcept { return superblock_; }
  /// The channels of the points and the texts that describe the file.
  [[nodiscard]] const Meta& meta() const noexcept { return meta_; }
  /// The number of pages, those of the directory not counted.
  [[nodiscard]] std::uint32_t page_count() const noexcept { return superblock_.page_count; }
  /// The largest payload that a page of this file may have: the page size less its header, bytes.
  [[nodiscard]] std::size_t page_payload_limit() const noexcept;

  /// Reads what a scene of parts says of its parts. It need not have opened them.
  /// @pre header().has_parts()
  [[nodiscard]] PartList read_parts() const;
  /// Says whether a page lies in the container's own file, and not in a part.
  [[nodiscard]] bool is_own(std::uint32_t page) const { return !part_page(page); }
  /// Returns the number that a page has in its file.
  [[nodiscard]] std::uint32_t own_number(std::uint32_t page) const;
  /// Returns the number of a page of the container's own file, from its number in that file.
  [[nodiscard]] std::uint32_t number_of(std::uint32_t own) const;
  /// Returns the number of the point behind a run that ends at `end`: `end`, but for the last run
  /// of a part.
  [[nodiscard]] std::uint64_t next_point(std::uint64_t end) const;
  /// Returns the number of a point without the gaps that follow parts.
  [[nodiscard]] std::uint64_t without_gaps(std::uint64_t point) const;
  /// The parts of a scene of parts, in the order of the curve; empty for any other container, and
  /// for one that was opened without them.
  [[nodiscard]] std::span<const std::unique_ptr<const ContainerReader>> parts() const noexcept {
    return parts_;
  }

  /// The directory entry of a page. The offset of a part's page is from the start of the part.
  [[nodiscard]] const DirectoryEntry& entry(std::uint32_t page) const;
  /// The rank of a page: the number of pages of the same type and group before it.
  [[nodiscard]] std::uint32_t rank(std::uint32_t page) const {
    return rank_of(numbers_, entries_, page);
  }
  /// The directory entries of all pages, by page number.
  [[nodiscard]] std::span<const DirectoryEntry> entries() const noexcept { return entries_; }
  /// The numbers of the point pages. The page of rank k holds the points from k *
  /// points_per_page(header()) on.
  [[nodiscard]] PageNumbers::Range point_pages() const noexcept { return numbers_.points(); }
  /// The numbers of the node pages, by rank.
  [[nodiscard]] PageNumbers::Range node_pages() const noexcept { return numbers_.nodes(); }
  /// The numbers of the attribute pages of a channel group: one for each point page, or none where
  /// the group does not exist.
  [[nodiscard]] PageNumbers::Range attribute_pages(std::uint8_t group) const noexcept {
    return numbers_.attributes(group);
  }
  /// The channel groups, ascending.
  [[nodiscard]] std::span<const std::uint8_t> groups() const noexcept { return numbers_.groups(); }
  /// The number of the meta page.
  [[nodiscard]] std::uint32_t meta_page() const noexcept { return numbers_.meta(); }
  /// The columns of a group's attribute pages, as ContainerWriter::write_page() takes them; empty
  /// where the group does not exist.
  [[nodiscard]] std::span<const PackedColumn> attribute_columns(std::uint8_t group) const;

  /// Reads a page, verifies it and decodes its payload.
  ///
  /// Point pages pass PointPage::verify(), node pages the checks of NodePage, and every child that
  /// a node page refers to exists.
  /// @param out      receives the payload in its first raw_bytes; at least page_payload_limit()
  ///                 bytes
  /// @param decoder  is used by one thread at a time
  /// @return         the header of the page
  PageHeader read_page(std::uint32_t page, std::span<std::byte> out, PageDecoder& decoder) const;

  /// Verifies and decodes a page as read_page() does, from bytes that the caller has read.
  /// @param image  the bytes of page_range(page)
  PageHeader decode_page(std::uint32_t page, std::span<const std::byte> image,
                         std::span<std::byte> out, PageDecoder& decoder) const;

  /// Where a page lies. A void page has no bytes.
  struct PageRange {
    std::uint64_t offset = 0;
    std::size_t bytes = 0;   ///< header and stored payload
    std::uint32_t part = 0;  ///< the file: 0 for the container's own, i + 1 for that of part i
  };
  [[nodiscard]] PageRange page_range(std::uint32_t page) const;

  /// Reads the header of a page and compares it with the directory. The payload is not read. A void
  /// page gets the header that its entry stands for, of 0 bytes.
  [[nodiscard]] PageHeader read_page_header(std::uint32_t page) const;

  /// Reads a page for copying: its checksum is verified, its payload stays as it is stored. That of
  /// a void page is empty.
  /// @param stored  receives the stored payload. References of a part's node page in it are the
  ///                part's own.
  PageHeader read_stored_page(std::uint32_t page, std::vector<std::byte>& stored) const;

 private:
  /// A page of a part, by its number in the part.
  struct PartPage {
    std::size_t part;
    std::uint32_t page;
  };
  /// Where a part begins.
  struct PartPlace {
    std::uint64_t first_point = 0;       ///< number of points in the parts before it
    std::uint64_t first_number = 0;      ///< of its first point, by which the gaps before it count
    std::uint32_t first_point_page = 0;  ///< rank
    std::uint32_t first_node_page = 0;   ///< rank
  };

  [[nodiscard]] PageHeader checked_header(std::uint32_t page,
                                          std::span<const std::byte> image) const;
  [[nodiscard]] PageHeader void_header(std::uint32_t page) const;
  [[nodiscard]] PageHeader void_page(std::uint32_t page, std::span<std::byte> out) const;
  [[nodiscard]] Meta read_meta() const;
  void open_parts();
  void open_part(const PartRecord& record);
  void join_parts();
  [[nodiscard]] std::optional<PartPage> part_page(std::uint32_t page) const;
  void renumber(std::span<std::byte> payload, std::uint32_t groups, std::size_t part) const;
  void renumber_top(std::span<std::byte> payload, std::uint32_t groups) const;

  InputFile file_;
  FileHeader header_;
  Superblock superblock_;
  std::vector<DirectoryEntry> entries_;
  PageNumbers numbers_;
  Meta meta_;
  GroupColumns columns_;
  std::vector<std::unique_ptr<const ContainerReader>> parts_;
  std::vector<PartPlace> places_;  ///< of the parts, and of the end behind them
};

}  // namespace ptc
