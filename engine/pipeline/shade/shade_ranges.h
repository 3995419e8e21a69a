// Shades the points of a scene range by range, on many machines, and collects the results.
//
//   receivers   |-------- batch --------|-------- batch --------|---- batch ----|
//   ranges      |             0                                 |       1       |   shade_range()
//                              \                                    /
//   points                       file with the bits of one machine collect_shading()
//
// The light of a receiver depends on those that are shaded with it, so that ranges end where the
// batches of a whole run end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/shade/shade_container.h"

namespace ptc {

/// Which of the ranges of a run, all of about equal length.
struct RangeNumber {
  std::size_t number = 0, of = 1;
};

/// Refuses what cannot be shaded range by range: other receivers than the points of one container,
/// estimated errors, reflections, shadows, groups of lights, a sky, damage, checks,
/// and the order of the input.
/// @param target  a file of points
/// @throws RequestError
void check_shade_by_ranges(const ShadeRequest& request, const std::filesystem::path& target);

/// Chooses the settings that shade a run's receivers and meet LightingRequest::error, as
/// shade_container() does.
/// @throws as shade_container()
/// Memory: at most RunOptions::memory_bytes.
[[nodiscard]] TuningReport choose_settings(const ShadeRequest& request,
                                           const std::filesystem::path& target, Progress& progress);

/// Shades a range of a run's receivers.
/// @param request  its settings are used as they are: LightingRequest::error is empty
/// @param plan    identity of the run
/// @param target  gets the results, whole or not at all; a range without receivers gives an empty
///                one
/// @throws as shade_container()
/// Memory: at most RunOptions::memory_bytes.
void shade_range(const ShadeRequest& request, RangeNumber range, std::uint64_t plan,
                 const std::filesystem::path& target, Progress& progress);

/// Shades a range of a run's receivers into a file of points of its own, which has what the file of
/// the whole run has of them.
/// @param request  as for shade_range()
/// @param target   a file of points; a range without receivers writes none
/// @return  whether the range has receivers
/// @throws as shade_container()
/// Memory: at most RunOptions::memory_bytes.
[[nodiscard]] bool shade_tile(const ShadeRequest& request, RangeNumber range,
                              const std::filesystem::path& target, Progress& progress);

/// Writes a part of the scene with the light of LightingRequest::bounces bounces, its edges beside
/// it. Joined, such parts are the LightingRequest::bounced of a run with one bounce more.
/// @param request  its scene is a scene of parts; its own LightingRequest::bounced is needed from
///                 two bounces on
/// @param part     index among the parts of the scene
/// @throws as shade_container()
/// Memory: at most RunOptions::memory_bytes.
void shade_part(const ShadeRequest& request, std::size_t part, const std::filesystem::path& target,
                Progress& progress);

/// Writes the file of points that shade_container() writes, from the results of all ranges.
/// @param request  as for shade_range()
/// @param results  of the ranges in their order
/// @throws DataError when results are damaged, or of another run, scene or range; as
///         shade_container()
void collect_shading(const ShadeRequest& request, const std::vector<std::filesystem::path>& results,
                     std::uint64_t plan, const std::filesystem::path& target, Progress& progress);

}  // namespace ptc
