// The number of rays by which reflections meet an error.
#pragma once

#include <span>

#include "engine/pipeline/quality/check_error.h"
#include "engine/pipeline/quality/pilots.h"
#include "engine/shade/shading.h"
#include "engine/trace/ray_shader.h"

namespace ptc {

/// Rays of each mirror where no error is asked for.
inline constexpr unsigned kMirrorRays = 64;

/// The most rays that tune_mirrors() chooses.
inline constexpr unsigned kMostMirrorRays = 1 << 16;

/// What was chosen for the mirrors of a run.
struct MirrorTuning {
  unsigned rays = kMirrorRays;  ///< of each receiver
  double noise = 0;  ///< measured as CheckError::relative(), with radiance for irradiance
  bool met = false;  ///< whether that is at most what is asked
};

/// Returns results of mirrors in the form in which errors are summed up: radiance in the place of
/// irradiance.
[[nodiscard]] std::vector<Shading> as_shading(std::span<const Reflection> reflections);

/// Doubles the number of rays until two independent results of each receiver differ by no more than
/// the error that is asked for. The result depends on neither threads nor memory cap.
/// @param pilots     whose compared receivers stand for the run
/// @param mirrors    its `rays` are not used
/// @param asked      relative error, above 0
[[nodiscard]] MirrorTuning tune_mirrors(RayShader& shader, std::span<const Pilot> pilots,
                                        Mirrors mirrors, double asked);

}  // namespace ptc
