// LAS files that tests make by hand.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/cloud/formats.h"
#include "tests/io/files.h"
#include "tests/support/temporary_directory.h"

namespace ptc::test {

/// The parts of a LAS file. bytes() puts them together; a test changes what it wants before.
struct LasFile {
  unsigned minor = 2;
  unsigned format = 0;
  unsigned record_bytes = 20;
  std::uint64_t points = 0;  ///< in the field of the version
  std::array<double, 3> scale = {0.01, 0.01, 0.01};
  std::array<double, 3> offset = {0, 0, 0};
  std::array<double, 3> low = {0, 0, 0}, high = {0, 0, 0};  ///< of the points
  std::vector<std::string> vlrs;
  std::string records;             ///< of the points
  std::vector<std::string> evlrs;  ///< of version 1.4 on

  [[nodiscard]] std::string bytes() const {
    const std::size_t header_bytes = minor >= 4 ? 375 : minor == 3 ? 235 : 227;
    std::size_t points_offset = header_bytes;
    for (const std::string& vlr : vlrs) points_offset += vlr.size();
    const auto u16 = [](std::size_t value) { return raw(static_cast<std::uint16_t>(value)); };
    const auto u32 = [](std::size_t value) { return raw(static_cast<std::uint32_t>(value)); };
    const auto text = [](std::string value) { return value.resize(32), value; };
    std::string out = "LASF" + u16(7) + u16(minor >= 4 ? 17 : 1) + "0123456789abcdef";
    out += static_cast<char>(1);
    out += static_cast<char>(minor);
    out += text("system \xe9") + text("by hand") + u16(32) + u16(2024);
    out += u16(header_bytes) + u32(points_offset) + u32(vlrs.size());
    out += static_cast<char>(format);
    out += u16(record_bytes) + u32(minor >= 4 ? 0 : points) + std::string(20, '\0');
    for (const double value : scale) out += raw(value);
    for (const double value : offset) out += raw(value);
    for (std::size_t axis = 0; axis < 3; ++axis) out += raw(high[axis]) + raw(low[axis]);
    if (minor >= 3) out += raw(std::uint64_t{0});
    if (minor >= 4) {
      out += raw(std::uint64_t{evlrs.empty() ? 0 : points_offset + records.size()});
      out += u32(evlrs.size()) + raw(points) + std::string(120, '\0');
    }
    for (const std::string& vlr : vlrs) out += vlr;
    out += records;
    for (const std::string& evlr : evlrs) out += evlr;
    return out;
  }
};

/// Returns a variable-length record, or an extended one.
inline std::string las_vlr(std::string_view user, unsigned number, std::string_view payload,
                           bool extended = false) {
  std::string padded(user);
  padded.resize(16);
  std::string out = raw(std::uint16_t{0}) + padded + raw(static_cast<std::uint16_t>(number));
  out += extended ? raw(std::uint64_t{payload.size()})
                  : raw(static_cast<std::uint16_t>(payload.size()));
  std::string description = "made for a test";
  description.resize(32);
  return out + description + std::string(payload);
}

/// Returns a record of point format 0.
inline std::string las_point(std::int32_t x, std::int32_t y, std::int32_t z) {
  return raw(x) + raw(y) + raw(z) + std::string(8, '\0');
}

/// What open_las() returns of a file.
struct LasCloud {
  PointFileInfo info;
  std::vector<Surfel> surfels;
  std::string rows;
};

/// Reads a file, a few points at a time.
[[nodiscard]] LasCloud read_las(const std::filesystem::path& path);
/// Reads a file of these bytes.
[[nodiscard]] LasCloud read_las(const TemporaryDirectory& scratch, const std::string& bytes);
/// Returns the error for a file of these bytes, without the path; empty when it is read.
[[nodiscard]] std::string las_fault(const TemporaryDirectory& scratch, const std::string& bytes);

}  // namespace ptc::test
