// The free space of directories, and texts that report it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace ptc {

/// Returns the bytes that a user may still write to these directories together. Directories on one
/// file system share its space, which is counted once.
/// @throws std::system_error that names the directory when the system does not report it
[[nodiscard]] std::uint64_t free_bytes(std::span<const std::filesystem::path> directories);

/// Returns the directory with the most free space. A directory whose free space is unknown counts
/// as full.
/// @param directories  at least one; the result refers to one of them
[[nodiscard]] const std::filesystem::path& roomiest(
    std::span<const std::filesystem::path> directories);

/// Checks that the directories have `bytes` bytes free together.
/// @param what  a plural noun for what will be written there, e.g. "5 files"; it begins the message
/// @throws std::system_error (ENOSPC) when they have fewer
void require_room(std::span<const std::filesystem::path> directories, std::uint64_t bytes,
                  const std::string& what);

/// Returns paths as a list for messages: "a", "a and b" or "a, b and c".
[[nodiscard]] std::string names_text(std::span<const std::filesystem::path> paths);

/// Returns an amount of bytes for messages: "12.3 GB", or "45.6 MB" when it is less than 1 GB.
[[nodiscard]] std::string amount_text(std::uint64_t bytes);

}  // namespace ptc
