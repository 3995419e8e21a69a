// Small containers, faults in them whose checksums are right, and what the check says of them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/surfel.h"
#include "format/container.h"
#include "tests/store/sample.h"

namespace ptc::test {

/// A room with a ball in it, lit unevenly: flat cells, round cells, colours.
[[nodiscard]] std::vector<Surfel> small_scene();

/// What verify_container() finds in a file, a line each; empty when nothing is wrong.
[[nodiscard]] std::string fault_of(const std::filesystem::path& path);

/// A container of raw pages in memory, whose payloads, page headers and superblock may be changed
/// and all checksums made right again.
class OpenContainer {
 public:
  /// @param path  of a container with codec raw and one directory page
  explicit OpenContainer(const std::filesystem::path& path);

  [[nodiscard]] std::size_t pages() const noexcept { return entries_.size(); }
  [[nodiscard]] PageHeader& header(std::size_t page) { return headers_[page]; }
  [[nodiscard]] std::span<std::byte> payload(std::size_t page);
  [[nodiscard]] Superblock& superblock() noexcept { return superblock_; }
  /// Writes it with checksums that are right.
  void write(const std::filesystem::path& target);

 private:
  std::vector<std::byte> bytes_;
  Superblock superblock_;
  std::vector<DirectoryEntry> entries_;
  std::vector<PageHeader> headers_;
};

}  // namespace ptc::test
