// Results by rays at the compared receivers of pilots: what settings are judged by.
//
//   few rays at all of them    |   |  |   |   |  |   |      tell the noise of each
//   as many as it takes        |   || |   ||| |  |   |||    more where there is more noise
#pragma once

#include <span>
#include <vector>

#include "engine/pipeline/quality/pilots.h"
#include "engine/trace/ray_shader.h"

namespace ptc {

/// Two independent results by rays for each compared receiver of some pilots, side by side, pilot
/// by pilot.
struct PilotRays {
  std::vector<Receiver> compared;
  std::vector<Shading> traced;  ///< twice as many
  double rays = 0;              ///< of a result, in the mean
  /// Number of rays of each receiver at which CheckError::relative_noise() is 1, as the noise of n
  /// rays falls as n^-0.6.
  double rays_of_noise_1 = 0;

  /// Estimates how many rays of each receiver have this noise.
  [[nodiscard]] double rays_for(double noise) const;
};

/// Returns the noise of one of the two results of a receiver, as CheckError::relative_noise().
/// @param traced  two results for each compared receiver, side by side, pilot by pilot
[[nodiscard]] double noise_of(std::span<const Pilot> pilots, std::span<const Shading> traced);

/// Traces the same number of rays at every receiver.
/// @param rays  for each of the two results of a receiver
[[nodiscard]] PilotRays trace_evenly(std::span<const Pilot> pilots, unsigned rays, RayShader& discs,
                                     Progress& progress);

/// Traces so many rays that the noise of a result is about `asked` in the mean of all receivers:
/// that is enough, since it is averaged out over some hundred. Where all have equal rays, those
/// that see small bright things have most of the noise: so they get more, and all others fewer.
[[nodiscard]] PilotRays trace_for(std::span<const Pilot> pilots, double asked, RayShader& discs,
                                  Progress& progress);

}  // namespace ptc
