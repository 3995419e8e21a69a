// The last stage of a build: sorted points become the pages of a container.
//
//      sorted points, a chain of streams
//             complete_scan       only for inputs without normals or radii
//                              v
//             merge_points        only with `append`: with the points of the scene
//                              v
//             unique_points       only with `remove_duplicates`
//                              v
//             round_points        only in the profiles fast and compact
//                              v
//             build_pages         octree and pages; checkpoints with `resume`
//                              v
//             AttributeSorts      attribute pages, group by group, in the same order
//                              v
//             ContainerWriter::finish()
//
// Each down to round_points is a PointStream that pulls blocks from the one before it, so that none
// holds more than its own blocks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/resume.h"
#include "engine/pipeline/build/still_light.h"
#include "engine/scan/scan.h"
#include "engine/sort/external_sort.h"
#include "engine/store/reader.h"

namespace ptc {

/// A sort that has taken all points, and what else the container is made with.
struct SortedPoints {
  std::unique_ptr<ExternalSorter> sorter;
  std::unique_ptr<AttributeSorts> attributes;
  std::uint64_t memory_bytes = 0;  ///< of the sort of points, which are free when it has ended
  BuildPlan plan;
  std::unique_ptr<StillLight> still_light;  ///< of the points of the scene; null: they keep theirs
};

/// What a build has opened when its points are sorted.
struct OpenBuild {
  const BuildRequest& request;
  const std::filesystem::path& target;  ///< beside which temporary files may lie
  const ContainerReader* scene;         ///< container that is appended to; null: none
  const Resumption* resumption;         ///< null: the build cannot be continued
  const Executor& executor;
  Progress& progress;  ///< in a stage that counts points
};

/// Builds a container from sorted points and publishes it.
/// @param path  of the container
/// @param scan  gets what was estimated of points without normals or radii
/// @return      the superblock of the container
/// @throws DataError when a kept file changed since it was written; FormatError, std::system_error
[[nodiscard]] Superblock build_sorted(const OpenBuild& open, SortedPoints& points,
                                      const std::filesystem::path& path, ScanReport& scan);

}  // namespace ptc
