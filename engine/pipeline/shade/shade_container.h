// Shades points: a container, and receivers, to shaded points.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "engine/base/progress.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// Points to shade by the light of a container's surfels.
struct ShadeRequest : LightingRequest {
  std::filesystem::path receivers;  ///< cloud or container to shade; empty: the scene's own points
  std::uint64_t count = 0;          ///< points to shade, evenly spread in order; 0: all
  std::optional<Sky> sky;           ///< empty: the sky that the scene was built with
};

/// Shades every receiver and writes it to `target`.
///
/// A .ptcx gets the receivers' container with the channels occlusion, bent_normal, irradiance, sky
/// and indirect, where indirect = albedo / pi * (irradiance + sky); a .ply gets the same as
/// columns. Estimates follow as occlusion_error and irradiance_error. Damage can be tolerated in
/// the scene's own points only when they go to a .ply.
/// @throws RequestError when the request excludes itself, LimitError for a cap that is too small,
///         DataError and FormatError for damaged input, std::system_error. Nothing is then left
///         under the target's name
LightingReport shade_container(const ShadeRequest& request, const std::filesystem::path& target,
                               Progress& progress);

}  // namespace ptc
