// Points with the light of each group of lights apart (spec/shading.md#light-groups).
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "engine/pipeline/shade/shade_container.h"

namespace ptc {

/// Shades the points of a container once for each group of its lights, and adds the results up.
/// @param settings     as for shaded_points()
/// @param las_records  BuildReport::las_records of the scene; empty: what its container keeps
/// @param shade        shades a scene without groups into a container
/// @throws RequestError as groups_of(), and when `count` or `sky` is given; as shade_container()
[[nodiscard]] LightingReport shade_groups(
    const ShadeRequest& request, const std::filesystem::path& target, const std::string& settings,
    const std::string& las_records,
    const std::function<LightingReport(const ShadeRequest&, const std::filesystem::path&)>& shade,
    Progress& progress);

}  // namespace ptc
