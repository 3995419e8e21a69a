// What a plan knows of the files that it was made from, so that a task refuses changed ones.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace ptc {

/// The state of a file, as it can be compared without reading all of it.
///
/// The state of a container is the checksum of its superblock, which covers the checksums of all
/// pages: no change goes unseen, and a copy of the same bytes is the same. The state of any other
/// file is the time of the last change and the checksum of the first and the last 64 KiB: a change
/// between them goes unseen if it leaves the length and the time as they were.
struct InputState {
  std::filesystem::path path;
  std::uint64_t bytes = 0;
  std::int64_t modified_ns = 0;  ///< since 1970; 0: a container
  std::uint64_t xxh3 = 0;
};

/// Returns an input, and the parts of a scene of parts.
/// @throws FormatError for a damaged container; std::system_error
[[nodiscard]] std::vector<std::filesystem::path> files_of(const std::filesystem::path& input);

/// Returns the states of files_of() an input.
/// @throws FormatError for a damaged container; std::system_error
[[nodiscard]] std::vector<InputState> states_of(const std::filesystem::path& input);

/// Refuses files that are not in the state that was recorded.
/// @throws DataError that names the file and what changed; FormatError; std::system_error
void require_unchanged(const std::vector<InputState>& recorded);

}  // namespace ptc
