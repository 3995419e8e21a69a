// Whole clouds in memory, for the tests of point readers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/io/cloud/points.h"
#include "tests/io/files.h"

namespace ptc {

/// Everything that a point file gives.
struct Cloud {
  PointFileInfo info;
  std::vector<Surfel> surfels;
  std::vector<std::byte> rows;  ///< of all surfels
  std::uint64_t left_out = 0;

  /// Returns a component of a channel of a point. @throws std::out_of_range for an unknown name
  [[nodiscard]] double value(std::size_t point, const std::string& channel,
                             std::size_t component = 0) const;
  /// Returns the channel of this name. @throws std::out_of_range when there is none
  [[nodiscard]] const Channel& channel(const std::string& name) const;
  /// Returns the names of all channels, separated by blanks.
  [[nodiscard]] std::string names() const;
  /// Returns all notes, separated by line ends.
  [[nodiscard]] std::string notes() const;
};

/// Reads a cloud in blocks of this many surfels.
[[nodiscard]] Cloud read_cloud(const std::filesystem::path& path, std::size_t block = 3);

/// Returns the error that reading a file of these bytes gives, without its path; empty for none.
[[nodiscard]] std::string cloud_fault(const test::TemporaryDirectory& scratch,
                                      const std::string& name, const std::string& bytes);

}  // namespace ptc
