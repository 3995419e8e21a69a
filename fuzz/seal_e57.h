// Repairs the checksums of an E57 file that was changed, so that readers refuse it by the rules of
// the format and not by its checksums.
#pragma once

#include <cstddef>
#include <span>

namespace ptc::fuzz {

/// Gives every page of an E57 file the checksum of its content, and the header the length of the
/// file. The page size is that of the header, or 1024 when that is no power of two from 64 to 2^20.
/// Bytes behind the last whole page stay as they are; so does a file of less than a page.
void seal_e57(std::span<std::byte> file);

}  // namespace ptc::fuzz
