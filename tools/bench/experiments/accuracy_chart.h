// Figures of error over time, one curve a method.
#pragma once

#include <string>
#include <vector>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/accuracy.h"

namespace ptc::bench {

/// What one scene's errors are against, and how good that is: a sentence or two.
[[nodiscard]] std::string note_text(const ReferenceNote& note, const SceneAccuracy& scene);

/// A row of panels for each set of receivers: occlusion, irradiance, the worst of it, the picture.
/// @param scene  with rows
[[nodiscard]] Chart chart_of(const SceneAccuracy& scene);

/// Occlusion and irradiance of every scene and set.
/// @param scenes  one or more, with rows
[[nodiscard]] Chart chart_of(const std::vector<SceneAccuracy>& scenes);

}  // namespace ptc::bench
