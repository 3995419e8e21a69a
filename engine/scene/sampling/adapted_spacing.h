// Finds where surfels of a mesh must lie close, and where few are enough.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/base/executor.h"
#include "engine/scene/ray_scene.h"
#include "engine/scene/sampling/patch_sampler.h"
#include "engine/scene/sampling/spacing_map.h"

namespace ptc {

/// The bytes that an adapted spacing takes for each surfel, at most.
inline constexpr std::uint64_t kAdaptingBytes = 32;

/// Returns spacings for about as many surfels as an even one gives: finer where the surface turns
/// or its light changes, wider where it is flat and evenly lit.
///
/// A sixteenth of the surfels is laid out evenly. In the cell of each, the angle between the
/// normals and their mean, and the standard deviation of the light that leaves it, over the mean
/// light of the mesh, add up, as squares, to the square of its detail. A surfel is wrong by about
/// its detail times its spacing, so that the sum of all squared errors is least where the spacing
/// goes with the root of one over the detail.
/// @param spacing  the even one, scene units, above 0
/// @param first    the first triangle that counts
/// @return         nothing where no surface is seen
[[nodiscard]] std::optional<SpacingMap> adapted_spacing(const PatchSampler& sampler,
                                                        const RayScene& scene, double spacing,
                                                        std::uint32_t first,
                                                        const Executor& executor);

}  // namespace ptc
