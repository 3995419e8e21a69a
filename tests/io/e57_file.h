// E57 files made by hand, for tests. Nothing here shares code with the reader.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/surfel.h"
#include "engine/io/cloud/points.h"

namespace ptc::test {

/// Returns the CRC-32C of bytes, computed bit by bit.
[[nodiscard]] std::uint32_t crc32c_by_bits(std::string_view bytes);

/// Splits logical bytes into pages of `page` bytes with a checksum each; zeros fill the last one.
[[nodiscard]] std::string e57_pages(std::string_view logical, std::size_t page);
/// Returns the bytes of pages without their checksums.
[[nodiscard]] std::string e57_logical(std::string_view file, std::size_t page);

/// Packs the lowest `width` bits of numbers, one bit after another.
[[nodiscard]] std::string e57_bits(const std::vector<std::uint64_t>& values, unsigned width);

/// Returns a data packet with a piece of each bytestream.
[[nodiscard]] std::string e57_packet(const std::vector<std::string>& streams, char flags = 0);

/// Collects scans and makes the bytes of a file of them.
class E57File {
 public:
  explicit E57File(std::size_t page = 1024) : page_(page) {}

  /// Adds a scan.
  /// @param fields   the elements of the prototype
  /// @param packets  the section behind its header
  /// @param more     further elements of the scan
  E57File& scan(const std::string& fields, std::uint64_t records, const std::string& packets,
                const std::string& more = {});
  /// Adds XML to the root element.
  E57File& root(const std::string& xml);
  /// Adds a section.
  /// @param length  what its header says; its true length without this
  /// @return its physical offset
  std::uint64_t section(const std::string& packets, std::uint64_t length = 0);
  /// Adds XML to data3D.
  E57File& data3d(const std::string& xml);

  /// Returns the file.
  [[nodiscard]] std::string bytes() const;

 private:
  std::size_t page_;
  std::string sections_ = std::string(48, '\0');  // logical bytes, room for the header first
  std::string scans_;                             // XML
  std::string root_;
};

/// Returns a field of a prototype, such as <rowIndex type="Integer" minimum="0" maximum="7"/>.
[[nodiscard]] std::string e57_field(const std::string& name, const std::string& type_and_more);

/// Returns fields of one type.
[[nodiscard]] std::string e57_fields(const std::vector<std::string>& names,
                                     const std::string& type_and_more);
/// Returns the fields of Cartesian coordinates in double precision.
[[nodiscard]] std::string e57_xyz();
/// Returns the bytestreams of e57_xyz() for points (0, 10, 20), (1, 11, 21) ...
[[nodiscard]] std::vector<std::string> e57_xyz_streams(std::size_t count);
/// Returns a packet of e57_xyz_streams() and `more` bytestreams.
[[nodiscard]] std::string e57_xyz_packet(std::size_t count, const std::vector<std::string>& more);

/// What a reader made of a file.
struct Cloud {
  PointFileInfo info;
  std::vector<Surfel> surfels;
  std::vector<std::byte> rows;  ///< of all surfels
  std::uint64_t left_out = 0;

  /// Returns the bits of a component of a channel, the rest zeros; all ones without this channel.
  [[nodiscard]] std::uint64_t bits(std::size_t point, std::string_view channel,
                                   std::size_t component = 0) const;
  /// Returns a component of a channel of type T.
  template <typename T>
  [[nodiscard]] T value(std::size_t point, std::string_view channel,
                        std::size_t component = 0) const {
    const std::uint64_t found = bits(point, channel, component);
    T result;
    std::memcpy(&result, &found, sizeof result);
    return result;
  }
  /// Returns the channel of a name. @throws std::out_of_range
  [[nodiscard]] const Channel& channel(std::string_view name) const;
};

/// Reads a file with open_e57().
/// @param block  surfels that are asked for at a time
[[nodiscard]] Cloud read_e57(const std::filesystem::path& path, std::size_t block = 7);
/// Makes a file of one scan with e57_xyz() and `fields`, whose bytestreams are `streams`, and reads
/// it.
/// @param more  further elements of the scan
[[nodiscard]] Cloud read_e57_scan(const std::string& fields, std::size_t count,
                                  const std::vector<std::string>& streams,
                                  const std::string& more = {});

}  // namespace ptc::test
