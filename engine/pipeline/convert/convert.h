// Converts containers: the entry point of the library that writes a container in another profile or
// page size. point_files.h has those for files of other formats.
//
//   const ptc::ContainerReader scene("dragon.ptcx");
//   ptc::Progress silent;
//   ptc::recode_container(scene, "small.ptcx", {.profile = ptc::Profile::compact}, silent);
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "engine/base/progress.h"
#include "engine/octree/rounding.h"
#include "engine/pipeline/convert/simplification.h"
#include "engine/pipeline/run.h"
#include "engine/store/reader.h"

namespace ptc {

/// Returns true when a file is a container: by its ending, which is .ptcx, or by its first bytes.
/// @throws std::system_error when the ending is another and the file cannot be read
[[nodiscard]] bool is_container(const std::filesystem::path& path);

/// The settings of recode_container().
struct RecodeOptions {
  Profile profile = Profile::exact;        ///< how points are rounded and compressed
  std::optional<std::uint8_t> page_shift;  ///< a page has 2^page_shift bytes; empty: as before
  /// What is simplified, for a profile that is_rounded(); empty: nothing. The points of a container
  /// with channels are not merged.
  std::optional<Simplification> simplification;
  std::string simplified;  ///< the text kSimplifiedKey of a container that is simplified
  RunOptions run;          ///< memory and threads; there are no temporary files
};

/// The result of a conversion, and what it cost.
struct ConvertReport {
  std::uint64_t points = 0;              ///< number of points that were written
  std::optional<Superblock> superblock;  ///< of the target when it is a container
  MergeCounts merged;                    ///< by a simplification
  StageSeconds seconds;                  ///< wall time of each stage
};

/// Writes a container again: the same points, channels and record in another profile or page size.
///
/// Points that are rounded already stay as they are, whatever the profile, unless they are
/// simplified. When the page size stays
/// and no points are to be rounded, pages keep their order and their numbers; otherwise the octree
/// is built again from the points. The same input gives the same bytes. The target is published
/// when it is complete; a conversion that throws leaves it as it was.
/// @throws RequestError when the record does not fit a page of the new size; LimitError when the
///         memory cap is too small: the text names the least that works; FormatError when the
///         container is damaged; std::system_error
/// Memory: at most RunOptions::memory_bytes.
ConvertReport recode_container(const ContainerReader& container,
                               const std::filesystem::path& target, const RecodeOptions& options,
                               Progress& progress);

}  // namespace ptc
