// Clauses of the specification that more than one file names in its errors.
#pragma once

namespace ptc::clause {

inline constexpr char kSuperblockMagic[] = "spec/container.md#superblock-magic";
inline constexpr char kSuperblockLength[] = "spec/container.md#superblock-length";
inline constexpr char kSuperblockCounts[] = "spec/container.md#superblock-counts";
inline constexpr char kDirectoryListing[] = "spec/container.md#directory-listing";
inline constexpr char kAttributePages[] = "spec/points.md#attribute-pages";
inline constexpr char kPartsTop[] = "spec/parts.md#parts-top";

}  // namespace ptc::clause
