// Clouds that a scene file sets into another place.
#pragma once

#include <filesystem>
#include <optional>

#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/selection.h"

namespace ptc {

/// Opens a cloud as open_point_input() does, and sets its points into a place. What the file says
/// of its place on the earth, the records of a LAS file and a camera hold there no more and are
/// left out; so is the axis that points up where the place turns, and the unit where it scales.
/// Lights that a container records move with it.
/// @param place  none: the points stay where they are
/// @throws as open_point_input()
[[nodiscard]] PointFile open_placed_points(const std::filesystem::path& path,
                                           const Selection& selection,
                                           const std::optional<Placement>& place);

}  // namespace ptc
