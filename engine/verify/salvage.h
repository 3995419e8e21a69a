// What is whole of a damaged container, as a new one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "engine/base/progress.h"
#include "engine/store/reader.h"

namespace ptc {

struct SalvageOptions {
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< cap on what the salvage holds
  std::uint64_t flip_budget = std::uint64_t{1}
                              << 39;  ///< bytes that may be hashed to turn flipped bits back
  unsigned threads = 0;               ///< 0: as many as cores
};

/// What a salvage kept.
struct SalvageReport {
  std::uint64_t points = 0;                    ///< in the new file
  std::optional<std::uint64_t> points_before;  ///< as the superblock says; without one nothing does
  std::uint64_t point_pages = 0;               ///< whole
  std::uint64_t point_pages_before = 0;        ///< as the superblock says, or as were found
  std::uint64_t attribute_pages = 0;           ///< whole and beside a whole point page
  std::uint64_t attribute_pages_before = 0;    ///< as the channels that are known want
  bool meta = false;                 ///< names and types of channels, and texts, were kept
  std::optional<double> area_share;  ///< of the area that the superblock says, 1 where that is 0
  std::optional<double> flux_share;  ///< of the flux, summed over colours, likewise: the energy
  Superblock superblock;             ///< of the new file
};

/// Writes a new container from every point page and attribute page that proves itself, or does with
/// one bit flipped back (spec/recovery.md#salvage). The octree is built again from the points, with
/// the usual leaves where no superblock says which. Channel values that are lost are 0.
/// @throws RequestError when the target is the file itself; FormatError when neither
/// header nor a superblock is whole, when features
///         forbid it or no point is left; LimitError naming the least cap; std::system_error
/// Memory: 320 bytes a page of the file, and what build_pages() takes.
SalvageReport salvage_container(const std::filesystem::path& path,
                                const std::filesystem::path& target, const SalvageOptions& options,
                                Progress& progress);

}  // namespace ptc
