// The cheapest setting of the gather that meets an error (spec/shading.md#error).
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "engine/pipeline/pipeline.h"
#include "engine/pipeline/quality/check.h"
#include "engine/shade/shader.h"

namespace ptc {

/// A setting, and the error that scenes have with it in the middle.
struct Rung {
  float solid_angle, parallax;
  unsigned resolution;
  double usual_error;

  /// @param run  says which sides of surfels stop light, and whether colours bleed
  [[nodiscard]] GatherOptions options(const GatherOptions& run) const {
    return {.solid_angle = solid_angle,
            .parallax = parallax,
            .resolution = resolution,
            .sides = run.sides,
            .bleeding = run.bleeding};
  }
};

/// From coarse and cheap to fine.
[[nodiscard]] std::span<const Rung> ladder();

/// Neighbours among the receivers of a run: shaded together, some of them compared with rays.
struct Pilot {
  static constexpr std::size_t kCompared = 8;  ///< evenly spread; all of fewer

  std::vector<Receiver> receivers;
  unsigned variant = 0;  ///< as Shader::shade()

  /// How many are compared.
  [[nodiscard]] std::size_t compared() const noexcept {
    return std::min(kCompared, receivers.size());
  }
  /// Place of the k-th of those.
  [[nodiscard]] std::size_t compared_at(std::size_t k) const noexcept {
    return (2 * k + 1) * receivers.size() / (2 * compared());
  }
};

/// How many pilots stand for a run, and how long they are.
struct PilotPlan {
  std::size_t count = 0;      ///< 0 only for an empty run
  std::uint64_t stride = 0;   ///< from the beginning of one to that of the next
  std::size_t receivers = 0;  ///< of each, at most `stride`
};
/// @param receivers  of the run
[[nodiscard]] PilotPlan plan_pilots(std::uint64_t receivers);

/// Compares pilots with rays at the same surfels, finds the cheapest setting.
/// @param options  but for its gather, of which only the sides count; its cache_bytes are the cap
/// of the
///                 rays too, StreamedRays::kLeastBytes at least
/// @param compared  the pilots' receivers that were, appended
/// @param traced    gets two by rays of each of them, side by side and pilot by pilot
[[nodiscard]] TuningReport tune(const ContainerReader& scene, const ShadeOptions& options,
                                double asked, std::span<const Pilot> pilots,
                                const Executor& executor, Progress& progress,
                                ReceiverPlaces& compared, std::vector<Shading>& traced);

/// What a setting of the ladder gives and costs.
struct RungError {
  CheckError error;
  double us_per_receiver = 0;  ///< CPU time
};

/// Compares pilots with rays at every setting of the ladder.
/// @param options  as tune()
/// @param rays     for each half of a reference, a square number
[[nodiscard]] std::vector<RungError> climb(const ContainerReader& scene,
                                           const ShadeOptions& options,
                                           std::span<const Pilot> pilots, unsigned rays,
                                           const Executor& executor, Progress& progress);

}  // namespace ptc
