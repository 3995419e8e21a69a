// Finds the cheapest way of shading that meets an error (spec/shading.md#error): the gather at one
// of a ladder of settings, or rays.
//
//   ladder()   coarse, cheap  |--|--|--|--|--|--|--|--|--|--|--|--|--|--|  fine, slow
//                                       ^        usual error of the rungs: where the search begins
//              even pilots              |==>|    choose a rung by bisection
//              odd pilots                   |>|  confirm it, or climb on
//
//   rays       as many as the noise at the pilots says, where that costs less
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/pipeline/quality/check_error.h"
#include "engine/pipeline/quality/pilots.h"
#include "engine/shade/shader.h"

namespace ptc {

/// One setting of the ladder, and the error that it usually leads to.
struct Rung {
  float solid_angle, parallax;  ///< as in GatherOptions
  unsigned resolution;          ///< as in GatherOptions
  double usual_error;           ///< mean over three scenes, as CheckError::relative()

  /// Returns the options of a gather with this setting.
  /// @param run  options of the run, which keep their sides and the light that they are about
  [[nodiscard]] GatherOptions options(const GatherOptions& run) const {
    return {.solid_angle = solid_angle,
            .parallax = parallax,
            .resolution = resolution,
            .sides = run.sides,
            .bleeding = run.bleeding,
            .emission = run.emission};
  }
};

/// Returns all settings to choose from, from coarse and cheap to fine and slow.
[[nodiscard]] std::span<const Rung> ladder();

/// Returns what the gather costs at a setting, as counts tell it, microseconds of CPU a receiver:
/// fitted, and off by a quarter.
[[nodiscard]] double gather_cost(const Rung& rung, const GatherWork& work);
/// Returns what so many rays of a receiver cost, as gather_cost() does.
[[nodiscard]] double ray_cost(unsigned rays);

/// The result of a search for settings that meet an error (spec/shading.md#error).
struct TuningReport {
  double asked = 0;      ///< error that was asked for, as CheckError::relative()
  bool met = false;      ///< false: the finest setting was taken, and `measured` is its error
  GatherOptions gather;  ///< setting that was chosen
  /// Rays of a receiver, where these cost less than the gather at that setting; 0: the gather
  /// shades
  unsigned receiver_rays = 0;
  unsigned setting = 0;   ///< index of that setting in ladder()
  unsigned settings = 0;  ///< size of ladder()
  /// Error of the setting or of the rays at the pilots that did not choose; at all pilots when
  /// `met` is false or there is only one pilot.
  CheckError measured;
  /// Bounds of `measured` as CheckError::relative(), at a confidence of 90 %: one in 20 resamples
  /// of those pilots has a lower error than `low`, and one in 20 a higher one than `high`.
  double low = 0, high = 0;
  std::size_t pilots = 0;        ///< number of receivers compared with rays
  unsigned rays = 0;             ///< rays of each of these receivers, in the mean
  std::uint64_t shaded = 0;      ///< receivers that were shaded, over all settings that were tried
  double ray_cpu_seconds = 0;    ///< CPU time of the rays, all threads
  double shade_cpu_seconds = 0;  ///< CPU time of the gathers, all threads
};

/// The rungs at which candidates are shaded.
inline constexpr std::array<std::size_t, 2> kSurveyed{0, 3};

/// Seed of the rays of the first receiver of a run that is shaded by rays: far from those of rays
/// that results are compared with.
inline constexpr std::uint64_t kRunSeed = std::uint64_t{1} << 40;

/// Compares pilots with rays at the same surfels and finds the cheapest way to meet `asked`.
/// The result depends on neither threads nor memory cap: what costs less is told from counts.
/// @param options   options of the run. Of its gather, only the sides and the light that it is
///                  about count. Its cache_bytes are the cap of the rays too
/// @param asked     relative error, above 0 and at most 1
/// @param by_rays   whether rays may shade the receivers
/// @param pilots    their compared receivers are chosen anew; their number in all stays
/// @param traced    gets two results by rays for each compared receiver, side by side, pilot by
///                  pilot
/// @throws FormatError when a page is damaged; std::system_error
[[nodiscard]] TuningReport tune(const ContainerReader& scene, const ShadeOptions& options,
                                double asked, bool by_rays, std::span<Pilot> pilots,
                                const Executor& executor, Progress& progress,
                                std::vector<Shading>& traced);

/// The error and the cost of one setting of the ladder.
struct RungError {
  CheckError error;
  double us_per_receiver = 0;  ///< CPU time of one receiver, microseconds
};

/// Compares pilots with rays at every setting of the ladder.
/// @param options  as for tune()
/// @param rays     number of rays of each of the two results of a receiver
/// @return         one row for each setting, in the order of ladder()
[[nodiscard]] std::vector<RungError> climb(const ContainerReader& scene,
                                           const ShadeOptions& options,
                                           std::span<const Pilot> pilots, unsigned rays,
                                           const Executor& executor, Progress& progress);

}  // namespace ptc
