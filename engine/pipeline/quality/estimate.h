// Estimates the error of every receiver (spec/shading.md#estimate).
//
// Every receiver is shaded with two variants of the gather. Where the results differ much, their
// errors are likely to be large. The scale comes from the pilots, whose errors are known from rays:
// a line is fitted to them and then gives the error of every receiver.
//
//   squared error
//     |          .   .
//     |     .     _.-'        one dot for each pilot receiver
//     |  .   _.-' .
//     |  _.-'   .             ErrorLine: constant + slope * squared difference
//     +------------------ squared difference of the variants
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/pipeline/quality/pilots.h"
#include "engine/shade/shader.h"

namespace ptc {

/// The estimated error of one receiver: a root mean square, not a bound.
struct ErrorEstimate {
  float occlusion = 0;   ///< absolute: occlusion goes from 0 to 1
  float irradiance = 0;  ///< W / m^2, root mean square over RGB
};

/// A model of the error: squared error = constant + slope * squared difference of two variants.
/// Neither coefficient is negative.
struct ErrorLine {
  double constant = 0, slope = 0;
  /// Returns the squared error that belongs to a squared difference.
  [[nodiscard]] double at(double squared_difference) const {
    return constant + slope * squared_difference;
  }
};

/// A receiver whose error is known.
struct ErrorSample {
  double squared_difference = 0;  ///< of the results of two variants
  double squared_error = 0;       ///< unbiased, so that a single one may be negative
  double weight = 1;              ///< how many receivers it stands for
};

/// Fits a line to samples by least squares, with neither coefficient negative. The weighted mean of
/// the line over the samples is that of their errors. Both coefficients are 0 when there are no
/// samples or that mean is not positive.
[[nodiscard]] ErrorLine fit_errors(std::span<const ErrorSample> samples);

/// The basis and the cost of the estimates of a run.
struct EstimateReport {
  std::size_t pilots = 0;  ///< number of receivers compared with rays
  /// CPU time of all threads for shading every receiver with the second variant, and the pilots
  /// with both; the rays are not included.
  double cpu_seconds = 0;
};

/// The quality of the estimates of one quantity, at receivers that had no part in making them.
///
/// The error of a single receiver is its distance to the mean of its two results by rays; it
/// includes their noise. The RMS errors are free of it. All members are 0 when there is no error.
struct EstimateWorth {
  double rank = 0;  ///< correlation of the ranks of estimates and errors (Spearman 1904)
  /// RMS error of the tenth with the largest estimates, over the RMS error of all receivers.
  double top_tenth = 0;
  /// RMS error of the tenth with the smallest estimates, over the RMS error of all receivers.
  double bottom_tenth = 0;
  /// RMS error of the third with the largest estimates, over the RMS error of all receivers.
  double top_third = 0;
  /// RMS error of the third with the smallest estimates, over the RMS error of all receivers.
  double bottom_third = 0;
  double rms = 0;           ///< RMS of the estimates over the RMS error
  double within_twice = 0;  ///< share of receivers whose error is at most twice the estimate
};

/// The quality of the estimates of a run.
struct EstimateCheck {
  EstimateWorth occlusion, irradiance;
};

/// Returns the number of readers of the page cache that a run has at once.
/// @param options   of the run
/// @param estimate  every receiver is shaded once more, to estimate its error
[[nodiscard]] inline unsigned readers_of(const Executor& executor, const ShadeOptions& options,
                                         bool estimate) {
  return (options.readers() + (estimate ? 1 : 0)) * executor.threads();
}

/// Traces rays at the compared receivers of the pilots, for a run whose settings tune() does not
/// choose.
/// @param rays      number of rays for each receiver, as CheckRequest::rays
/// @param compared  gets the receivers that were compared
/// @return          two results for each compared receiver, side by side, pilot by pilot
/// Memory: ShadeOptions::cache_bytes, freed before it returns.
[[nodiscard]] std::vector<Shading> trace_pilots(const ContainerReader& scene,
                                                const ShadeOptions& options,
                                                std::span<const Pilot> pilots, unsigned rays,
                                                const Executor& executor, Progress& progress,
                                                ReceiverPlaces& compared);

/// Estimates errors: shades every receiver of a run with a second variant of the gather, and
/// compares. The results depend on neither threads nor memory cap.
/// Memory: ShadeOptions::cache_bytes for readers_of() readers. The Shader of the run reads through
/// the same cache.
class Estimator {
 public:
  /// Shades the pilots with both variants and fits the lines.
  /// @param scene, executor  must outlive this
  /// @param options          options of the run's Shader
  /// @param traced           two results by rays for each compared receiver, as trace_pilots()
  Estimator(const ContainerReader& scene, const ShadeOptions& options,
            std::span<const Pilot> pilots, std::span<const Shading> traced,
            const Executor& executor);

  /// The cache that the Shader of the run must read through.
  [[nodiscard]] PageCache& cache() noexcept { return *cache_; }

  /// Estimates the errors of shaded receivers.
  /// @param results  results of the run's Shader for the same receivers and variant
  /// @return         one estimate for each receiver, valid until the next call
  std::span<const ErrorEstimate> estimate(std::span<const Receiver> receivers,
                                          std::span<const Shading> results, unsigned variant = 0);

  [[nodiscard]] const EstimateReport& report() const noexcept { return report_; }
  /// Statistics of the cache over both variants. Call Shader::cache_statistics() of the run first.
  [[nodiscard]] CacheStatistics cache_statistics() const { return other_->cache_statistics(); }

 private:
  /// Shades the pilots and returns the results of their compared receivers.
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
/// @param ours    results of the gather
/// @param traced  two results by rays for each receiver, side by side
[[nodiscard]] EstimateCheck check_estimates(std::span<const ErrorEstimate> estimates,
                                            std::span<const Shading> ours,
                                            std::span<const Shading> traced);

}  // namespace ptc
