// The window of the camera's picture, for those who look at pictures rather than at numbers.
#pragma once

#include <span>

#include "tools/bench/experiments/accuracy.h"

namespace ptc::bench {

/// Mean FLIP of the window between two shadings of it: grey for occlusion, else surfaces as they
/// are lit, at an exposure that shows all but the brightest fiftieth of the reference. NaN when the
/// set has no window.
/// @param ours, reference  one for each pixel that sees something
/// @param sky              radiance that arrives where nothing covers it
[[nodiscard]] double window_flip(const ReceiverSet& set, std::span<const Shading> ours,
                                 std::span<const Shading> reference, Quantity job,
                                 const glm::vec3& sky);

}  // namespace ptc::bench
