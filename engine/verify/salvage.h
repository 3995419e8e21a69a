// Salvage: a new container from the intact pages of a damaged one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "engine/base/progress.h"
#include "engine/store/reader.h"

namespace ptc {

/// Limits of a salvage.
struct SalvageOptions {
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< cap on the memory of the salvage
  std::uint64_t flip_budget = std::uint64_t{1}
                              << 39;  ///< bytes that may be hashed to find and undo flipped bits
  unsigned threads = 0;               ///< 0: one for each core
};

/// What a salvage kept, next to what the file held before.
struct SalvageReport {
  std::uint64_t points = 0;                    ///< points in the new file
  std::optional<std::uint64_t> points_before;  ///< points of the superblock; empty without one
  std::uint64_t point_pages = 0;               ///< intact point pages that were kept
  std::uint64_t point_pages_before = 0;        ///< by the superblock; without one, pages found
  std::uint64_t attribute_pages = 0;           ///< intact, and belonging to a kept point page
  std::uint64_t attribute_pages_before = 0;    ///< one for each known group and point page
  bool meta = false;                 ///< names and types of channels, and texts, were kept
  std::optional<double> area_share;  ///< kept share of the superblock's area; 1 when that is 0
  std::optional<double> flux_share;  ///< kept share of the superblock's flux summed over colours,
                                     ///< i.e. of the energy; 1 when that is 0
  Superblock superblock;             ///< superblock of the new file
};

/// Writes a new container from every point page and attribute page whose checksums hold, or hold
/// after one bit is flipped back (spec/recovery.md#salvage). The octree is built again from the
/// points, with the leaf size of the superblock, or the default where none is left. Lost channel
/// values become their `no_value`, or 0. Of a scene of parts one file is made, from those of its
/// parts that are there.
/// @throws RequestError when the target is the file itself or one of its parts
/// @throws FormatError when neither the header nor a superblock is intact, when a feature of the
///         file forbids it, or when no point is left
/// @throws LimitError naming the smallest cap that works; std::system_error
/// Memory: 320 bytes for each page of the file, and what build_pages() takes.
SalvageReport salvage_container(const std::filesystem::path& path,
                                const std::filesystem::path& target, const SalvageOptions& options,
                                Progress& progress);

}  // namespace ptc
