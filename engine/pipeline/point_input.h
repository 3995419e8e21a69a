// The points of an input: a cloud, a container, or clusters of its octree, all or some of them.
#pragma once

#include <filesystem>
#include <memory>

#include "engine/base/stream.h"
#include "engine/io/cloud/points.h"
#include "engine/pipeline/selection.h"
#include "engine/store/reader.h"

namespace ptc {

/// Says whether a file holds points: it is a container or a cloud.
[[nodiscard]] bool holds_points(const std::filesystem::path& path);

/// Opens the points of a file that a selection takes, for one pass. Of a container only the pages
/// are read that may hold points of the box, and only the groups of channels that are needed.
///
/// A container gives its texts except those about how it was made: the names of its inputs, its
/// spacing, its rounding, its shading. The channel original_index is left out, because its numbers
/// would count points that are not there.
/// @throws RequestError when the selection needs a channel that the file lacks, or a level of a
/// file
///         that is no container; DataError, FormatError, std::system_error
[[nodiscard]] PointFile open_point_input(const std::filesystem::path& path,
                                         const Selection& selection = {});

/// Opens the points of an open container that a selection takes, with all rows that it keeps.
/// @param container  must outlive the result
[[nodiscard]] std::unique_ptr<PointSource> open_selected(const ContainerReader& container,
                                                         const Selection& selection);

}  // namespace ptc
