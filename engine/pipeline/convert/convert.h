// One kind of file into another.
#pragma once

#include <filesystem>
#include <optional>

#include "engine/base/progress.h"
#include "engine/octree/rounding.h"
#include "engine/pipeline/run.h"
#include "engine/store/reader.h"

namespace ptc {

/// True when a file is a container by its name or, whatever its name, by its first bytes.
/// @throws std::system_error
[[nodiscard]] bool is_container(const std::filesystem::path& path);

struct RecodeOptions {
  Profile profile = Profile::exact;
  std::optional<std::uint8_t> page_shift;  ///< empty: as it was
  RunOptions run;
};

/// What a conversion moved.
struct ConvertReport {
  std::uint64_t points = 0;
  std::optional<Superblock> superblock;  ///< of the target when it is a container
  StageSeconds seconds;
};

/// Writes the points of a container with all its channels as columns of a PLY.
/// @throws FormatError, std::system_error   Memory: the open container and a few pages, within
/// kBufferBytes.
ConvertReport container_to_ply(const ContainerReader& container,
                               const std::filesystem::path& target, Progress& progress);

/// Writes the points of a container as lines "x y z nx ny nz radius r g b", r g b the radiance;
/// every number reads back to the same bits.
ConvertReport container_to_xyz(const ContainerReader& container,
                               const std::filesystem::path& target, Progress& progress);

/// Writes a container anew: the same points, channels and record in another profile or page size.
/// What was rounded stays so. While the page size stays and points are not rounded, pages keep
/// their order and numbers; else the octree is built again from the points. The same input gives
/// the same bytes.
/// @throws FormatError, std::system_error, LimitError for a cap that is too small; RequestError
/// when
///         the record does not fit a page of the new size
ConvertReport recode_container(const ContainerReader& container,
                               const std::filesystem::path& target, const RecodeOptions& options,
                               Progress& progress);

}  // namespace ptc
