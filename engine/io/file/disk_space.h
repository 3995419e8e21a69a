// What directories have room for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace ptc {

/// Bytes that a user may still write to these directories; those on one file system share its room.
/// @throws std::filesystem::filesystem_error (a std::system_error) naming the directory
[[nodiscard]] std::uint64_t free_bytes(std::span<const std::filesystem::path> directories);

/// The directory with most room. @param directories  at least one
[[nodiscard]] const std::filesystem::path& roomiest(
    std::span<const std::filesystem::path> directories);

/// True when one of the directories is on the file system of `path`.
[[nodiscard]] bool share_a_disk(std::span<const std::filesystem::path> directories,
                                const std::filesystem::path& path);

/// @param what  is going to be written there, e.g. "5 files": begins the message
/// @throws std::system_error (ENOSPC) when the directories have less free than that, together
void require_room(std::span<const std::filesystem::path> directories, std::uint64_t bytes,
                  const std::string& what);

/// "a", "a and b" or "a, b and c", for messages.
[[nodiscard]] std::string names_text(std::span<const std::filesystem::path> paths);

/// "12.3 GB", or "45.6 MB" below one, for messages.
[[nodiscard]] std::string amount_text(std::uint64_t bytes);

}  // namespace ptc
