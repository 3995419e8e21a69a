// Finds the cheapest settings of the gather that meet an error (spec/shading.md#error).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/pipeline/quality/check_error.h"
#include "engine/pipeline/quality/pilots.h"
#include "engine/shade/shader.h"

namespace ptc {

/// One setting of the ladder, with the error that scenes usually have with it.
struct Rung {
  float solid_angle, parallax;  ///< as in GatherOptions
  unsigned resolution;          ///< as in GatherOptions
  double usual_error;           ///< as CheckError::relative()

  /// The setting for a run that gives its own sides and bleeding.
  [[nodiscard]] GatherOptions options(const GatherOptions& run) const {
    return {.solid_angle = solid_angle,
            .parallax = parallax,
            .resolution = resolution,
            .sides = run.sides,
            .bleeding = run.bleeding};
  }
};

/// All settings to choose from, from coarse and cheap to fine.
[[nodiscard]] std::span<const Rung> ladder();

/// What became of an error that was asked for (spec/shading.md#error).
struct TuningReport {
  double asked = 0;       ///< as CheckError::relative()
  bool met = false;       ///< false: the finest setting was taken, and `measured` is its error
  GatherOptions gather;   ///< the setting that was chosen
  unsigned setting = 0;   ///< its index in ladder()
  unsigned settings = 0;  ///< size of ladder()
  CheckError measured;  ///< at the pilots that did not choose it; at all pilots when it is not met
  std::size_t pilots = 0;        ///< number of receivers compared with rays
  unsigned rays = 0;             ///< rays for each of them
  std::uint64_t shaded = 0;      ///< receivers shaded to choose, over all settings that were tried
  double ray_cpu_seconds = 0;    ///< all threads, loading the surfels included
  double shade_cpu_seconds = 0;  ///< all threads
};

/// Compares pilots with rays at the same surfels and finds the cheapest setting that meets `asked`.
/// @param options   of the run. Of its gather only sides and bleeding count. Its cache_bytes, at
///                  least StreamedRays::kMinBytes, are the cap of the rays too
/// @param compared  gets the receivers of the pilots that were compared
/// @param traced    gets two results by rays for each compared receiver, side by side, pilot by
/// pilot
[[nodiscard]] TuningReport tune(const ContainerReader& scene, const ShadeOptions& options,
                                double asked, std::span<const Pilot> pilots,
                                const Executor& executor, Progress& progress,
                                ReceiverPlaces& compared, std::vector<Shading>& traced);

/// What a setting of the ladder gives and costs.
struct RungError {
  CheckError error;
  double us_per_receiver = 0;  ///< CPU time in microseconds
};

/// Compares pilots with rays at every setting of the ladder.
/// @param options  as for tune()
/// @param rays     for each half of a reference, a square number
[[nodiscard]] std::vector<RungError> climb(const ContainerReader& scene,
                                           const ShadeOptions& options,
                                           std::span<const Pilot> pilots, unsigned rays,
                                           const Executor& executor, Progress& progress);

}  // namespace ptc
