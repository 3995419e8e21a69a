// The clusters of one level of a container's octree as surfels: the scene at a coarse resolution.
#pragma once

#include <memory>
#include <optional>

#include "engine/base/stream.h"
#include "engine/base/surfel.h"
#include "engine/store/reader.h"

namespace ptc {

/// Opens the clusters of a level: one for each occupied cell of the octree of this level, and for
/// each leaf above it. Only the node pages of this level and of those above are read.
///
/// A cluster becomes a surfel at its mean, with its mean normal, the radius of a disc of its area,
/// and the radiance that leaves it along that normal. Where normals cancel out, it is the axis that
/// most of the area faces. The albedo is 0.5.
/// @param level      1 or more: level 1 has the eight cells of the frame
/// @param box        clusters whose bounding spheres lie outside of it are left out; scene units
/// @param container  must outlive the result
/// @throws FormatError when a page is damaged; std::system_error
/// Memory: a page cache of 16 MiB at most.
[[nodiscard]] std::unique_ptr<PointSource> open_level(const ContainerReader& container,
                                                      unsigned level,
                                                      const std::optional<Bounds>& box);

}  // namespace ptc
