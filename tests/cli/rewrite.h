// Containers with faults whose checksums are right.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "format/container.h"

namespace ptc::test {

[[nodiscard]] std::vector<std::byte> read_file(const std::filesystem::path& path);
void write_file(const std::filesystem::path& path, const std::vector<std::byte>& bytes);

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
