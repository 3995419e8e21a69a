// What a build takes on its disks, told before it begins.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "engine/octree/rounding.h"

namespace ptc {

/// Room that a build wants and finds. All 0 where the number of points is not known beforehand.
struct BuildSpace {
  std::uint64_t temp_bytes = 0;         ///< of temporary files; 0: memory holds all
  std::uint64_t temp_free_bytes = 0;    ///< in their directories
  std::uint64_t output_bytes = 0;       ///< of the container, about
  std::uint64_t output_free_bytes = 0;  ///< in its directory
};

/// @param points      about how many
/// @param temp_bytes  of temporary files
/// @throws std::system_error (ENOSPC) naming what is wanted and what is free, when the output's
/// directory has less
///         free than the points alone take at the least
[[nodiscard]] BuildSpace require_build_space(std::uint64_t points, std::uint64_t temp_bytes,
                                             Profile profile,
                                             std::span<const std::filesystem::path> temp_dirs,
                                             const std::filesystem::path& target);

/// "12.0 GB of temporary files in /a and /b, 80.1 GB free; about 3.9 GB for scene.ptcx, 80.1 GB
/// free"
[[nodiscard]] std::string space_text(const BuildSpace& space,
                                     std::span<const std::filesystem::path> temp_dirs,
                                     const std::filesystem::path& target);

}  // namespace ptc
