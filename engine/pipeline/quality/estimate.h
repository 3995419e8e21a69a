// An estimate of what every receiver is off (spec/shading.md#estimate).
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/pipeline/pipeline.h"
#include "engine/pipeline/quality/check.h"
#include "engine/pipeline/quality/tuning.h"
#include "engine/shade/shader.h"

namespace ptc {

/// Squared error = constant + slope * squared difference of two variants, neither negative.
struct ErrorLine {
  double constant = 0, slope = 0;
  [[nodiscard]] double at(double squared_difference) const {
    return constant + slope * squared_difference;
  }
};

/// A receiver whose error is known.
struct ErrorSample {
  double squared_difference = 0;
  double squared_error = 0;  ///< without bias: single ones may be negative
};

/// The line of least squares, then scaled so that it has the mean of the errors. Zeros for no
/// samples, or where that mean is not positive.
[[nodiscard]] ErrorLine fit_errors(std::span<const ErrorSample> samples);

/// @throws std::invalid_argument when estimates are wanted of a run that compares nothing with rays
void check_estimate_request(bool estimate, const std::optional<double>& error,
                            const CheckRequest& check);

/// How many gathers a run has at once.
[[nodiscard]] inline unsigned readers_of(const Executor& executor, bool estimate) {
  return (estimate ? 2 : 1) * executor.threads();
}

/// Rays at the pilots where no tune() traced them.
/// @param rays      for each receiver, as CheckRequest::rays
/// @param compared  gets those receivers
/// @return          two of each, as tune() tells them
[[nodiscard]] std::vector<Shading> trace_pilots(const ContainerReader& scene,
                                                const ShadeOptions& options,
                                                std::span<const Pilot> pilots, unsigned rays,
                                                const Executor& executor, Progress& progress,
                                                ReceiverPlaces& compared);

/// Shades receivers with another variant too; how far both are apart tells how far off they may be,
/// by what is true of the pilots.
///
/// Results depend on neither threads nor cap.
/// Memory: ShadeOptions::cache_bytes, for as many gathers as readers_of(); the run's Shader reads
/// through the same cache.
class Estimator {
 public:
  /// Shades the pilots with both variants.
  /// @param options  of the run
  /// @param traced   two of each receiver that is compared
  Estimator(const ContainerReader& scene, const ShadeOptions& options,
            std::span<const Pilot> pilots, std::span<const Shading> traced,
            const Executor& executor);

  /// What the run's Shader reads through too.
  [[nodiscard]] PageCache& cache() noexcept { return *cache_; }

  /// @param results  of the run's Shader, for the same receivers and variant
  /// @return  valid until the next call
  std::span<const ErrorEstimate> estimate(std::span<const Receiver> receivers,
                                          std::span<const Shading> results, unsigned variant = 0);

  [[nodiscard]] const EstimateReport& report() const noexcept { return report_; }
  /// Of both variants, once the run's Shader has told its own.
  [[nodiscard]] CacheStatistics cache_statistics() const { return other_->cache_statistics(); }

 private:
  /// @param turn  added to their variants
  [[nodiscard]] std::vector<Shading> shade_compared(const SceneView& view,
                                                    std::span<const Pilot> pilots, unsigned turn,
                                                    const Executor& executor) const;

  ShadeOptions options_;
  std::unique_ptr<PageCache> cache_;
  std::unique_ptr<Shader> other_;
  ErrorLine occlusion_, irradiance_;
  EstimateReport report_;
  std::vector<Shading> shaded_;
  std::vector<ErrorEstimate> estimates_;
};

/// How estimates hold at receivers that were traced.
/// @param traced  two of each, side by side
[[nodiscard]] EstimateCheck check_estimates(std::span<const ErrorEstimate> estimates,
                                            std::span<const Shading> ours,
                                            std::span<const Shading> traced);

}  // namespace ptc
