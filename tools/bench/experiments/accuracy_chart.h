// Charts of error over time, with one curve for each method.
#pragma once

#include <string>
#include <vector>

#include "tools/bench/chart/chart.h"
#include "tools/bench/experiments/accuracy.h"

namespace ptc::bench {

/// One or two sentences about the reference of one scene and set, and its own error.
[[nodiscard]] std::string note_text(const ReferenceNote& note, const SceneAccuracy& scene);

/// Makes the chart of one scene, with a row of panels for each set of receivers: occlusion,
/// irradiance, the 99th percentile of irradiance, the difference of pictures (FLIP).
/// @param scene  with one row or more
[[nodiscard]] Chart chart_of(const SceneAccuracy& scene);

/// Makes the chart of all scenes, with a panel of occlusion and one of irradiance for each set.
/// @param scenes  one or more, each with one row or more
[[nodiscard]] Chart chart_of(const std::vector<SceneAccuracy>& scenes);

}  // namespace ptc::bench
