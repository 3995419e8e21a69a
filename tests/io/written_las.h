// LAS files that the writer has written, and where their parts are. Offsets are those of ASPRS LAS
// 1.4 R15.
#pragma once

#include <catch2/catch.hpp>

#include "tests/io/files.h"
#include "tests/io/writer_inputs.h"

namespace ptc::test {

/// A LAS file that was written, and where its parts are.
struct Las {
  std::string bytes;

  explicit Las(const std::filesystem::path& path) : bytes(slurp(path)) {}
  template <typename T>
  [[nodiscard]] T at(std::size_t offset) const {
    return number_at<T>(bytes, offset);
  }
  [[nodiscard]] std::size_t points_begin() const { return at<std::uint32_t>(96); }
  [[nodiscard]] std::size_t point_bytes() const { return at<std::uint16_t>(105); }
  [[nodiscard]] int format() const { return at<std::uint8_t>(104); }
  [[nodiscard]] int encoding() const { return at<std::uint16_t>(6); }
  template <typename T>
  [[nodiscard]] T point(std::size_t index, std::size_t offset) const {
    return at<T>(points_begin() + index * point_bytes() + offset);
  }
  /// Returns the content of a record between header and points; empty when there is none.
  [[nodiscard]] std::string record(const std::string& user, int id) const {
    std::size_t place = 375;
    for (std::uint32_t i = 0; i < at<std::uint32_t>(100); ++i) {
      const std::size_t size = at<std::uint16_t>(place + 20);
      const std::string name = std::string(bytes.substr(place + 2, 16).c_str());
      if (name == user && at<std::uint16_t>(place + 18) == id)
        return bytes.substr(place + 54, size);
      place += 54 + size;
    }
    CHECK(place == points_begin());
    return {};
  }
  /// Returns the extended records, headers included, by the fields of the header.
  [[nodiscard]] std::string extended_records() const {
    const auto count = at<std::uint32_t>(243);
    const auto begin = static_cast<std::size_t>(at<std::uint64_t>(235));
    if (count == 0) {
      CHECK(begin == 0);
      return {};
    }
    CHECK(begin == points_begin() + at<std::uint64_t>(247) * point_bytes());
    std::size_t place = begin;
    for (std::uint32_t i = 0; i < count; ++i)
      place += 60 + static_cast<std::size_t>(at<std::uint64_t>(place + 20));
    CHECK(place == bytes.size());
    return bytes.substr(begin);
  }
  /// Returns the names of the extra bytes with their types, such as "radius 9".
  [[nodiscard]] std::vector<std::string> extra_names() const {
    const std::string list = record("LASF_Spec", 4);
    CHECK(list.size() % 192 == 0);
    std::vector<std::string> names;
    for (std::size_t i = 0; i < list.size(); i += 192) {
      std::string name = list.substr(i + 4, 32);
      name.resize(std::min<std::size_t>(name.find('\0'), 32));
      names.push_back(name + " " + std::to_string(list[i + 2]));
    }
    return names;
  }
};

/// Writes a LAS file of these points.
inline Las written(const PointWriteInfo& info, const std::vector<Surfel>& surfels,
                   const std::vector<std::byte>& rows = {}) {
  const TemporaryDirectory scratch;
  write_points(scratch / "a.las", OutputFormat::las, info, surfels, rows);
  return Las(scratch / "a.las");
}

}  // namespace ptc::test
