// The facts of a page that its header and its directory entry both record, and the rules that both
// keep.
#pragma once

#include <cstdint>

#include "format/container.h"

namespace ptc {

/// Checks type, sizes, group, level, first key and record count of a page
/// (spec/container.md#page-header). A void entry passes; whether it may be void is its caller's
/// question.
/// @param facts  as an entry has them; `offset` is not looked at
/// @throws FormatError with offset 0, because header and entry keep the fields in different places
void check_page_facts(const DirectoryEntry& facts, const FileHeader& file);

/// Writes bytes 8 to 119 of the file header, which the superblock repeats, to the same place in
/// `block`.
void encode_identity(const FileHeader& header, std::span<std::byte, kBlockBytes> block) noexcept;

}  // namespace ptc
