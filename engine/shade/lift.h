// Lifts receivers off the surfels that they lie on.
#pragma once

#include "engine/base/surfel.h"
#include "engine/shade/shading.h"
#include "format/morton.h"

namespace ptc {

/// Returns how far a receiver rises above a surfel, scene units.
///
///            o receiver
///            |  lift * radius       Discs are flat where the surface curves, so a receiver in the
///     -------+-------               plane of a disc would lie behind those of its neighbours.
///         surfel
///
/// A radius above SceneScale::kMaxLiftedRadius edges of the frame counts as that many, and the
/// result is finite.
/// @param radius  of the surfel, scene units
/// @param lift    height over radius
/// @param frame   the frame of the scene
/// Source: spec/shading.md#lift
[[nodiscard]] float lift_height(float radius, float lift, const Frame& frame) noexcept;

/// Returns the receiver above a surfel: lifted along the surfel's normal, with that normal.
/// @param lift   height over the surfel's radius
/// @param frame  the frame of the surfel's scene
[[nodiscard]] Receiver lifted(const Surfel& surfel, float lift, const Frame& frame) noexcept;

}  // namespace ptc
