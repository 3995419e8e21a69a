// Opens a container and reads its pages (spec/container.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "engine/io/file/file.h"
#include "format/codec.h"
#include "format/container.h"
#include "format/schema.h"

namespace ptc {

/// A container open for reading. Opening checks header, superblocks (the second when the first is
/// damaged), directory, meta page, and that the directory's pages make up one scene; a page's
/// checksum is checked each time it is read. Padding between pages is not looked at.
/// Threads: reading may be called concurrently.   Memory: kPageBytes a page, at
/// most kMaxPageBytes while it opens.
class ContainerReader {
 public:
  /// @throws FormatError whose message begins with the path and whose offset is that in the file,
  /// as for every function here, with the number of the page at fault where one is read;
  /// std::system_error; DataError when the file shrinks meanwhile
  explicit ContainerReader(const std::filesystem::path& path);
  ~ContainerReader();

  static constexpr std::uint64_t kPageBytes = 36;      ///< of memory a page
  static constexpr std::uint64_t kMaxPageBytes = 100;  ///< while it opens

  [[nodiscard]] const std::filesystem::path& path() const noexcept;
  [[nodiscard]] const FileHeader& header() const noexcept;
  [[nodiscard]] const Superblock& superblock() const noexcept;
  [[nodiscard]] const Meta& meta() const noexcept;
  [[nodiscard]] std::uint32_t page_count() const noexcept;
  [[nodiscard]] std::size_t page_payload_limit() const noexcept;  ///< page size - 64
  /// @throws std::invalid_argument when there is no such page, as for every function here
  [[nodiscard]] const DirectoryEntry& entry(std::uint32_t page) const;
  [[nodiscard]] std::span<const DirectoryEntry> entries() const noexcept;  ///< by page
  /// Pages of a kind by ascending number: the k-th point page holds points k * points_per_page on.
  [[nodiscard]] std::span<const std::uint32_t> point_pages() const noexcept;
  [[nodiscard]] std::span<const std::uint32_t> node_pages() const noexcept;
  [[nodiscard]] std::span<const std::uint32_t> attribute_pages(std::uint16_t group) const;
  /// Columns of a group's attribute pages, for ContainerWriter::write_page(); none where there is
  /// no such group.
  [[nodiscard]] std::span<const PackedColumn> attribute_columns(std::uint16_t group) const;

  /// Reads, verifies and decodes a page's payload. Point and node pages also pass the checks of
  /// PointPage::verify() and NodePage, and each child that a node page refers to exists.
  /// @param out      at least page_payload_limit() bytes
  /// @param decoder  one per thread
  /// @return the page's header; the payload is the first raw_bytes of `out`
  /// @throws FormatError naming path, offset and page
  PageHeader read_page(std::uint32_t page, std::span<std::byte> out, PageDecoder& decoder) const;
  /// The same of a page whose bytes are at hand.
  /// @param image  page_range() of file()
  PageHeader decode_page(std::uint32_t page, std::span<const std::byte> image,
                         std::span<std::byte> out, PageDecoder& decoder) const;
  /// Where the header and the stored bytes of a page are.
  struct PageRange {
    std::uint64_t offset = 0;
    std::size_t bytes = 0;
  };
  [[nodiscard]] PageRange page_range(std::uint32_t page) const;
  [[nodiscard]] const InputFile& file() const noexcept;
  /// The header of a page, compared with the directory; its payload is not read.
  [[nodiscard]] PageHeader read_page_header(std::uint32_t page) const;
  /// The payload as it is stored, checksum verified, not decoded, for copying.
  PageHeader read_stored_page(std::uint32_t page, std::vector<std::byte>& stored) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
