// Compares the window of the camera's picture as a viewer sees it.
#pragma once

#include <span>

#include "tools/bench/experiments/accuracy.h"

namespace ptc::bench {

/// Returns the mean FLIP between two shadings of the window. The picture shows occlusion in grey,
/// or else lit surfaces at an exposure that shows all but the brightest fiftieth of the reference.
/// NaN when the set has no window.
/// @param ours, reference  one for each pixel that sees something
/// @param sky              radiance that arrives where nothing covers it
[[nodiscard]] double window_flip(const ReceiverSet& set, std::span<const Shading> ours,
                                 std::span<const Shading> reference, Quantity job,
                                 const glm::vec3& sky);

}  // namespace ptc::bench
