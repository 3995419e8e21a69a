// Chooses how many surfels a build makes of its meshes, by the error that they lead to
// (spec/shading.md#surfel-count).
//
//   16k, even and adapted    the better of the two is kept
//   16k -> 40k -> 90k        more, while the error is above what is asked; fewer, while below
//        60k <-              the geometric middle, until the two nearest are within a fifth
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/quality/surface_error.h"
#include "engine/pipeline/run.h"

namespace ptc {

/// A container that was built on trial.
struct SurfelTrial {
  std::uint64_t count = 0;   ///< SamplingOptions::count
  bool adapts = false;       ///< SamplingOptions::adapts
  std::uint64_t points = 0;  ///< that it has
  std::uint64_t bytes = 0;   ///< of its file
  BoundedError found;        ///< by a SurfaceJudge
  double cpu_seconds = 0;    ///< of its build
};

/// A sampling that was chosen.
struct SurfelChoice {
  double asked = 0;                 ///< error that was asked for, as CheckError::relative()
  bool met = false;                 ///< false: no number of surfels that was tried meets it
  SurfelTrial taken;                ///< the trial that was chosen
  std::vector<SurfelTrial> trials;  ///< all of them, in their order
};

/// Builds containers of the meshes of a request, and compares them with these.
class SurfelTrials {
 public:
  /// @param request  whose meshes are sampled; its count, spacing and adaption do not matter
  /// @param target   as for roomiest_temp_dir()
  /// @throws RequestError when it has anything but meshes
  SurfelTrials(const BuildRequest& request, const std::filesystem::path& target);

  /// Builds a container, which is gone when it has been measured.
  /// @param count, adapts  as in SamplingOptions
  /// @throws as build_container(); as SurfaceJudge::measure(); RequestError when the meshes do not
  ///         fit in memory
  [[nodiscard]] SurfelTrial run(std::uint64_t count, bool adapts);

 private:
  BuildRequest request_;
  std::filesystem::path target_;
  ThreadPool executor_;
  SurfaceJudge judge_;
};

/// Chooses the fewest surfels, evenly spread or adapted to the surface, whose error is at most
/// `asked` in 19 of 20 resamples of the places that are compared, to within a fifth. Where more
/// surfels stop making the error smaller, it takes the fewest ones that are about as good.
/// @param asked  as CheckError::relative()
/// @param run    runs a trial with a SamplingOptions::count and ::adapts
[[nodiscard]] SurfelChoice search_surfels(
    double asked, const std::function<SurfelTrial(std::uint64_t, bool)>& run);

/// Chooses how the meshes of a request are sampled: search_surfels() with SurfelTrials. The choice
/// depends on the request alone: resources that are too small for it are refused.
/// @param asked     relative error, above 0 and at most 1
/// @param seconds   gets a row
/// @param progress  gets a stage that counts the surfels of the trials, and a note when the error
///                  is not met
/// @throws RequestError when `asked` is out of range; as SurfelTrials
[[nodiscard]] SurfelChoice choose_surfels(const BuildRequest& request, double asked,
                                          const std::filesystem::path& target,
                                          StageSeconds& seconds, Progress& progress);

}  // namespace ptc
