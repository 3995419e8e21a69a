// Reads that reach the disk, and what they brought.
#pragma once

#include <cstdint>

#include "engine/io/file/file.h"

namespace ptc::bench {

/// Bytes that disks gave to this process so far; 0 where the system does not say.
[[nodiscard]] std::uint64_t disk_bytes();

/// Takes what the system keeps of a file out of its cache, where that can be done.
void forget(const InputFile& file);

}  // namespace ptc::bench
