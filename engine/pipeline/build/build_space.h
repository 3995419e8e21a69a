// The disk space of a build, estimated and checked before it begins.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "engine/octree/rounding.h"

namespace ptc {

/// Disk space that a build needs and finds. All members are 0 when the number of points is not
/// known beforehand.
struct BuildSpace {
  std::uint64_t temp_bytes = 0;         ///< size of the temporary files; 0: memory holds all points
  std::uint64_t temp_free_bytes = 0;    ///< free in the temporary directories together
  std::uint64_t output_bytes = 0;       ///< usual size of a container with this many points
  std::uint64_t output_free_bytes = 0;  ///< free in the directory of the container
};

/// Estimates the disk space of a build and refuses a build that cannot fit.
/// @param points      expected number of points; 0 when it is not known
/// @param temp_bytes  expected size of the temporary files
/// @return            the estimate; all 0 when `points` is 0
/// @throws std::system_error (ENOSPC) when the output's directory has less space than the points
///         take at least; the text names the need and the free space
[[nodiscard]] BuildSpace require_build_space(std::uint64_t points, std::uint64_t temp_bytes,
                                             Profile profile,
                                             std::span<const std::filesystem::path> temp_dirs,
                                             const std::filesystem::path& target);

/// Returns the note that a user reads: "12.0 GB of temporary files in /a and /b, 80.1 GB free;
/// about 3.9 GB for scene.ptcx, 80.1 GB free".
[[nodiscard]] std::string space_text(const BuildSpace& space,
                                     std::span<const std::filesystem::path> temp_dirs,
                                     const std::filesystem::path& target);

}  // namespace ptc
