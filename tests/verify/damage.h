// Small containers, faults in them under correct checksums, and what the verifier reports.
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

/// Returns a room with a ball in it, lit unevenly: flat cells, round cells, colours.
[[nodiscard]] std::vector<Surfel> small_scene();

/// Returns what verify_container() finds in a file, one line for each fault; empty when it finds
/// none.
[[nodiscard]] std::string fault_of(const std::filesystem::path& path, unsigned threads = 1);

/// A container of raw pages in memory. Payloads, page headers and superblock can be changed;
/// write() corrects all checksums.
class OpenContainer {
 public:
  /// @param path  a container with codec raw and one directory page
  explicit OpenContainer(const std::filesystem::path& path);

  [[nodiscard]] std::size_t pages() const noexcept { return entries_.size(); }
  [[nodiscard]] PageHeader& header(std::size_t page) { return headers_[page]; }
  [[nodiscard]] std::span<std::byte> payload(std::size_t page);
  [[nodiscard]] Superblock& superblock() noexcept { return superblock_; }
  /// Writes the container with correct checksums.
  void write(const std::filesystem::path& target);

 private:
  std::vector<std::byte> bytes_;
  Superblock superblock_;
  std::vector<DirectoryEntry> entries_;
  std::vector<PageHeader> headers_;
};

}  // namespace ptc::test
