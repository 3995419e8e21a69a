// Opens a container and reads its pages (spec/container.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "engine/io/file/file.h"
#include "engine/store/page_content.h"
#include "engine/store/structure.h"
#include "format/codec.h"
#include "format/container.h"
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
/// Threads: all functions may be called concurrently.
/// Memory: kPageBytes for each page; up to kMaxPageBytes for each while it opens.
class ContainerReader {
 public:
  /// Opens a container.
  explicit ContainerReader(const std::filesystem::path& path);
  ContainerReader(const ContainerReader&) = delete;
  ContainerReader& operator=(const ContainerReader&) = delete;

  static constexpr std::uint64_t kPageBytes = 36;      ///< memory of an open container, per page
  static constexpr std::uint64_t kMaxPageBytes = 100;  ///< memory while it opens, per page

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }
  [[nodiscard]] const InputFile& file() const noexcept { return file_; }
  [[nodiscard]] const FileHeader& header() const noexcept { return header_; }
  [[nodiscard]] const Superblock& superblock() const noexcept { return superblock_; }
  /// The channels of the points and the texts that describe the file.
  [[nodiscard]] const Meta& meta() const noexcept { return meta_; }
  /// The number of pages, those of the directory not counted.
  [[nodiscard]] std::uint32_t page_count() const noexcept { return superblock_.page_count; }
  /// The largest payload that a page of this file may have: the page size less its header, bytes.
  [[nodiscard]] std::size_t page_payload_limit() const noexcept;

  /// The directory entry of a page.
  [[nodiscard]] const DirectoryEntry& entry(std::uint32_t page) const;
  /// The directory entries of all pages, by page number.
  [[nodiscard]] std::span<const DirectoryEntry> entries() const noexcept { return entries_; }
  /// The numbers of the point pages, ascending. The k-th one holds the points from
  /// k * points_per_page on.
  [[nodiscard]] std::span<const std::uint32_t> point_pages() const noexcept {
    return index_.points;
  }
  /// The numbers of the node pages, ascending.
  [[nodiscard]] std::span<const std::uint32_t> node_pages() const noexcept { return index_.nodes; }
  /// The numbers of the attribute pages of a channel group, ascending: one for each point page, or
  /// none where the group does not exist.
  [[nodiscard]] std::span<const std::uint32_t> attribute_pages(std::uint16_t group) const;
  /// The columns of a group's attribute pages, as ContainerWriter::write_page() takes them; empty
  /// where the group does not exist.
  [[nodiscard]] std::span<const PackedColumn> attribute_columns(std::uint16_t group) const;

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

  /// Where a page lies in the file.
  struct PageRange {
    std::uint64_t offset = 0;
    std::size_t bytes = 0;  ///< header and stored payload
  };
  [[nodiscard]] PageRange page_range(std::uint32_t page) const;

  /// Reads the header of a page and compares it with the directory. The payload is not read.
  [[nodiscard]] PageHeader read_page_header(std::uint32_t page) const;

  /// Reads a page for copying: its checksum is verified, its payload stays as it is stored.
  /// @param stored  receives the stored payload
  PageHeader read_stored_page(std::uint32_t page, std::vector<std::byte>& stored) const;

 private:
  [[nodiscard]] PageHeader agreed_header(std::uint32_t page,
                                         std::span<const std::byte> image) const;
  [[nodiscard]] PageHeader checked_header(std::uint32_t page,
                                          std::span<const std::byte> image) const;
  [[nodiscard]] Meta read_meta() const;

  InputFile file_;
  FileHeader header_;
  Superblock superblock_;
  std::vector<DirectoryEntry> entries_;
  PageIndex index_;
  Meta meta_;
  GroupColumns columns_;
};

}  // namespace ptc
