// The pages of an E57 file, and the logical bytes that they carry (ASTM E2807, file layout).
//
//   physical  | payload 1020 | crc 4 | payload 1020 | crc 4 | ...      what offsets of the file
//   count logical   | payload 1020         | payload 1020         | ...      what lengths of the
//   file count
//
// The checksum is the CRC-32C of the payload with its highest byte first; all else is
// little-endian.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "engine/io/file/file.h"

namespace ptc {

/// Reads the logical bytes of an E57 file. The checksum of a page is checked before any byte of the
/// page is returned.
///
/// Memory: 64 KiB, or one page when that is more; a page has at most 1 MiB.
class E57Pages {
 public:
  /// Opens a file and checks its header against its length.
  /// @throws DataError when the header breaks a rule; std::system_error
  explicit E57Pages(const std::filesystem::path& path);

  /// Returns the path of the file.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }
  /// Returns the number of logical bytes in the file.
  [[nodiscard]] std::uint64_t size() const noexcept;
  /// Returns the logical offset of the XML section.
  [[nodiscard]] std::uint64_t xml_offset() const noexcept { return xml_offset_; }
  /// Returns the length of the XML section, logical bytes that lie within the file.
  [[nodiscard]] std::uint64_t xml_bytes() const noexcept { return xml_bytes_; }

  /// Returns the logical offset of a physical one.
  /// @param what  what begins there, for errors: "the XML section"
  /// @param at    logical offset of the place that names `physical`, for errors
  /// @throws DataError when it lies behind the end of the file or inside a checksum
  [[nodiscard]] std::uint64_t logical(std::uint64_t physical, const std::string& what,
                                      std::uint64_t at) const;
  /// Returns the physical offset of a logical one.
  [[nodiscard]] std::uint64_t physical(std::uint64_t logical) const noexcept;

  /// Fills `out` with the logical bytes from `offset` on.
  /// @throws DataError when the file ends before `out` is full or the checksum of a page is wrong;
  ///         std::system_error
  void read(std::uint64_t offset, std::span<std::byte> out);

  /// Refuses the file because of the byte at a logical offset.
  /// @throws DataError "PATH: offset N: RULE", where N is the physical offset
  [[noreturn]] void fail_at(std::uint64_t offset, const std::string& rule) const;

 private:
  /// Returns the payload of a page, whose checksum is right. The view is valid until the next call.
  [[nodiscard]] std::span<const std::byte> payload(std::uint64_t page);
  /// Reads and checks page size and length. @return the page size
  [[nodiscard]] std::uint64_t read_page_bytes() const;

  InputFile file_;
  std::uint64_t page_bytes_ = 0;  // with its checksum
  std::uint64_t pages_ = 0;
  std::uint64_t xml_offset_ = 0;
  std::uint64_t xml_bytes_ = 0;
  std::vector<std::byte> window_;   // consecutive pages
  std::uint64_t first_ = 0;         // page that window_ begins with
  std::uint64_t window_pages_ = 0;  // pages in window_
  std::uint64_t checked_ = 0;       // bit k: the checksum of page first_ + k is right
};

}  // namespace ptc
