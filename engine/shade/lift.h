// Receivers above surfels.
#pragma once

#include "engine/base/surfel.h"
#include "engine/shade/shading.h"
#include "format/morton.h"

namespace ptc {

/// How far a receiver rises above a surfel, in scene units.
///
/// Radii above SceneScale::kMaxLiftedRadius edges of the frame count as that, and the result is
/// finite.
/// @param radius  of the surfel, scene units
/// @param lift    in radii
/// @param frame   of the scene
[[nodiscard]] float lift_height(float radius, float lift, const Frame& frame) noexcept;

/// The receiver above a surfel.
/// @param lift   in radii of the surfel
/// @param frame  of the surfel's scene
[[nodiscard]] Receiver lifted(const Surfel& surfel, float lift, const Frame& frame) noexcept;

}  // namespace ptc
