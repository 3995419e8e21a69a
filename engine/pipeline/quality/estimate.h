// Estimates the error of every receiver (spec/shading.md#estimate).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/pipeline/quality/pilots.h"
#include "engine/shade/shader.h"

namespace ptc {

/// The estimated error of one receiver: a root mean square, not a bound.
struct ErrorEstimate {
  float occlusion = 0;
  float irradiance = 0;  ///< W / m^2, root mean square over RGB
};

/// A model of the error: squared error = constant + slope * squared difference of two variants.
/// Neither coefficient is negative.
struct ErrorLine {
  double constant = 0, slope = 0;
  [[nodiscard]] double at(double squared_difference) const {
    return constant + slope * squared_difference;
  }
};

/// A receiver whose error is known.
struct ErrorSample {
  double squared_difference = 0;  ///< of two variants
  double squared_error = 0;       ///< unbiased, so that single ones may be negative
};

/// The line of least squares, scaled so that its mean is the mean of the errors. Both coefficients
/// are 0 without samples and where that mean is not positive.
[[nodiscard]] ErrorLine fit_errors(std::span<const ErrorSample> samples);

/// What the estimates of a run were made of.
struct EstimateReport {
  std::size_t pilots = 0;  ///< receivers compared with rays
  /// CPU time of all threads for shading with another variant, and the pilots with both; the rays
  /// are not included.
  double cpu_seconds = 0;
};

/// How good the estimates of one quantity are at receivers that had no part in them. The error of a
/// single receiver is against both halves of its rays and includes their noise; the ratios are
/// without it, and 0 where there is no error.
struct EstimateWorth {
  double rank = 0;       ///< correlation of the ranks of estimates and errors (Spearman 1904)
  double top_tenth = 0;  ///< RMS error of the tenth with the largest estimates, over that of all
  double bottom_tenth =
      0;                 ///< RMS error of the tenth with the smallest estimates, over that of all
  double top_third = 0;  ///< RMS error of the third with the largest estimates, over that of all
  double bottom_third = 0;  ///< RMS error of the third with the smallest, over that of all
  double rms = 0;           ///< RMS of the estimates over that of the errors
  double within_twice = 0;  ///< share of receivers whose error is at most twice the estimate
};

/// How good the estimates of a run are.
struct EstimateCheck {
  EstimateWorth occlusion, irradiance;
};

/// Number of gathers that a run has at once.
/// @param estimate  every receiver is shaded twice, to estimate its error
[[nodiscard]] inline unsigned readers_of(const Executor& executor, bool estimate) {
  return (estimate ? 2 : 1) * executor.threads();
}

/// Traces rays at the pilots of a run for which tune() was not called.
/// @param rays      for each receiver, as CheckRequest::rays
/// @param compared  gets the receivers of the pilots that were compared
/// @return          two results for each compared receiver, in the order of tune()'s `traced`
[[nodiscard]] std::vector<Shading> trace_pilots(const ContainerReader& scene,
                                                const ShadeOptions& options,
                                                std::span<const Pilot> pilots, unsigned rays,
                                                const Executor& executor, Progress& progress,
                                                ReceiverPlaces& compared);

/// Shades every receiver with a second variant of the gather. The distance between the two results
/// tells how large their errors may be; the pilots, whose errors are known, give the scale.
///
/// Results depend on neither threads nor cap.
/// Memory: ShadeOptions::cache_bytes for readers_of() gathers. The Shader of the run reads through
/// the same cache.
class Estimator {
 public:
  /// Shades the pilots with both variants.
  /// @param options  of the run
  /// @param traced   two results by rays for each compared receiver
  Estimator(const ContainerReader& scene, const ShadeOptions& options,
            std::span<const Pilot> pilots, std::span<const Shading> traced,
            const Executor& executor);

  /// The cache that the Shader of the run must read through.
  [[nodiscard]] PageCache& cache() noexcept { return *cache_; }

  /// @param results  of the Shader of the run, for the same receivers and variant
  /// @return         one estimate for each receiver, valid until the next call
  std::span<const ErrorEstimate> estimate(std::span<const Receiver> receivers,
                                          std::span<const Shading> results, unsigned variant = 0);

  [[nodiscard]] const EstimateReport& report() const noexcept { return report_; }
  /// Statistics of the cache over both variants. Call Shader::cache_statistics() of the run first.
  [[nodiscard]] CacheStatistics cache_statistics() const { return other_->cache_statistics(); }

 private:
  /// Shades the compared receivers of the pilots.
  /// @param turn  added to the variant of each pilot
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

/// Compares estimates with the errors of receivers that were traced.
/// @param traced  two results by rays for each receiver, side by side
[[nodiscard]] EstimateCheck check_estimates(std::span<const ErrorEstimate> estimates,
                                            std::span<const Shading> ours,
                                            std::span<const Shading> traced);

}  // namespace ptc
