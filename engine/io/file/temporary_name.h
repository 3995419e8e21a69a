// Names for files until they are published, which no other process on any machine gives.
#pragma once

#include <filesystem>

namespace ptc {

/// Returns ".NAME.tmp-HOST-PID-RANDOM-N" in the directory of the target: machines that share a file
/// system and containers that share a host name never get the same. Long parts are cut so that the
/// whole stays below 255 bytes.
[[nodiscard]] std::filesystem::path temporary_name(const std::filesystem::path& target);

/// Says whether a file has such a name and was left by a process that ended: one of this host that
/// is gone, or one of any host that has not written it for a day. Where containers share a host
/// name, their processes may count as gone while they run.
[[nodiscard]] bool is_leftover(const std::filesystem::path& file) noexcept;

}  // namespace ptc
