// The free space of file systems.
#include "engine/io/file/disk_space.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <set>
#include <system_error>

#include <fmt/format.h>

namespace ptc {
namespace {

// Returns the number of the file system of a path.
dev_t disk_of(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0)
    throw std::system_error(errno, std::generic_category(), "stat " + path.string());
  return status.st_dev;
}

}  // namespace

std::uint64_t free_bytes(std::span<const std::filesystem::path> directories) {
  std::set<dev_t> seen;
  std::uint64_t free = 0;
  for (const std::filesystem::path& directory : directories) {
    if (seen.insert(disk_of(directory)).second) free += std::filesystem::space(directory).available;
  }
  return free;
}

const std::filesystem::path& roomiest(std::span<const std::filesystem::path> directories) {
  return *std::ranges::max_element(directories, {}, [](const std::filesystem::path& directory) {
    std::error_code unknown;  // opening a file there will report what is wrong
    const std::filesystem::space_info room = std::filesystem::space(directory, unknown);
    return unknown ? 0 : room.available;
  });
}

void require_room(std::span<const std::filesystem::path> directories, std::uint64_t bytes,
                  const std::string& what) {
  const std::uint64_t free = free_bytes(directories);
  if (bytes <= free) return;
  throw std::system_error(
      ENOSPC, std::generic_category(),
      fmt::format("{} take up to {} in {}, with {} free; "
                  "name other or more directories in `run.temp_dirs`, or use fewer points",
                  what, amount_text(bytes), names_text(directories), amount_text(free)));
}

std::string names_text(std::span<const std::filesystem::path> paths) {
  std::string text;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (i > 0) text += i + 1 < paths.size() ? ", " : " and ";
    text += paths[i].string();
  }
  return text;
}

std::string amount_text(std::uint64_t bytes) {
  const auto count = static_cast<double>(bytes);
  // From 999.95 MB on, one digit behind the point would round to 1000.0 MB.
  return bytes < 999'950'000 ? fmt::format("{:.1f} MB", count / 1e6)
                             : fmt::format("{:.1f} GB", count / 1e9);
}

}  // namespace ptc
