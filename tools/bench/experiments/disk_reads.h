// Makes reads reach the disk, and counts the bytes that disks delivered.
#pragma once

#include <cstdint>

#include "engine/io/file/file.h"

namespace ptc::bench {

/// The number of bytes that this process has read from disks so far; 0 where the system does not
/// report it.
[[nodiscard]] std::uint64_t disk_bytes();

/// Asks the system to drop a file's pages from its cache. Pages that are dirty or mapped may stay.
void forget(const InputFile& file);

}  // namespace ptc::bench
