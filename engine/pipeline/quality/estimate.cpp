// The line of an estimate, and its worth.
//
// The squared error of a pilot receiver is the product of its distances to two independent results
// by rays (error_sums.h). It is unbiased, so the line is fitted to many of them; a single one says
// little and may be negative.
#include "engine/pipeline/quality/estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/trace/ray_shader.h"

namespace ptc {
namespace {

/// One quantity of a shading, as up to three numbers whose squares are averaged.
struct Quantity {
  std::size_t components = 1;
  std::array<double, 3> values{};
};

Quantity occlusion_of(const Shading& s) {
  return {1, {static_cast<double>(s.occlusion)}};
}
Quantity irradiance_of(const Shading& s) {
  const glm::dvec3 v(s.irradiance);
  return {3, {v.r, v.g, v.b}};
}

/// Returns the mean of (ours - a) (ours - b) over the components.
double product(const Quantity& ours, const Quantity& a, const Quantity& b) {
  double sum = 0;
  for (std::size_t c = 0; c < ours.components; ++c)
    sum += (ours.values[c] - a.values[c]) * (ours.values[c] - b.values[c]);
  return sum / static_cast<double>(ours.components);
}

double squared_difference(const Quantity& a, const Quantity& b) {
  return product(a, b, b);
}

/// Returns the rank of each value, counted from 0. Equal values share the mean of their ranks.
std::vector<double> ranks_of(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> ranks(values.size());
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;
    while (end < order.size() && values[order[end]] == values[order[i]]) ++end;
    for (std::size_t k = i; k < end; ++k) ranks[order[k]] = static_cast<double>(i + end - 1) / 2;
    i = end;
  }
  return ranks;
}

/// Returns the linear correlation of two series of equal length; 0 when one of them is constant.
double correlation(std::span<const double> a, std::span<const double> b) {
  const auto n = static_cast<double>(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / n,
               mean_b = std::accumulate(b.begin(), b.end(), 0.0) / n;
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

/// One quantity of a receiver that was compared with rays.
struct Checked {
  double estimate = 0;
  double error = 0;   ///< distance to the mean of both results by rays
  double square = 0;  ///< squared error, unbiased
};

/// Returns the RMS error of some receivers.
double rms_of(std::span<const Checked> checked) {
  double sum = 0;
  for (const Checked& c : checked) sum += c.square;
  return std::sqrt(std::max(0.0, sum) /
                   static_cast<double>(std::max<std::size_t>(1, checked.size())));
}

EstimateWorth worth_of(std::vector<Checked> checked) {
  // Sum up all receivers
  EstimateWorth worth;
  const double all = rms_of(checked);
  if (!(all > 0)) return worth;
  std::vector<double> estimates, errors;
  double squares = 0;
  std::size_t within = 0;
  for (const Checked& c : checked) {
    estimates.push_back(c.estimate);
    errors.push_back(c.error);
    squares += c.estimate * c.estimate;
    if (c.error <= 2 * c.estimate) ++within;
  }

  // Compare estimates with errors over all receivers
  const auto count = static_cast<double>(checked.size());
  worth.rank = correlation(ranks_of(estimates), ranks_of(errors));
  worth.rms = std::sqrt(squares / count) / all;
  worth.within_twice = static_cast<double>(within) / count;

  // Compare the receivers with the largest and the smallest estimates
  std::ranges::stable_sort(checked, {}, &Checked::estimate);
  const std::span<const Checked> sorted(checked);
  const std::size_t tenth = (sorted.size() + 9) / 10, third = (sorted.size() + 2) / 3;
  worth.top_tenth = rms_of(sorted.last(tenth)) / all;
  worth.bottom_tenth = rms_of(sorted.first(tenth)) / all;
  worth.top_third = rms_of(sorted.last(third)) / all;
  worth.bottom_third = rms_of(sorted.first(third)) / all;
  return worth;
}

/// Returns the worth of the estimates of one quantity.
/// @param which        the member of ErrorEstimate that estimates it
/// @param quantity_of  takes the quantity out of a Shading
template <class QuantityOf>
EstimateWorth worth_of(std::span<const ErrorEstimate> estimates, float ErrorEstimate::*which,
                       std::span<const Shading> ours, std::span<const Shading> traced,
                       const QuantityOf& quantity_of) {
  std::vector<Checked> checked;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const Quantity a = quantity_of(traced[2 * i]), b = quantity_of(traced[2 * i + 1]),
                   us = quantity_of(ours[i]);
    Quantity mean = a;
    for (std::size_t c = 0; c < mean.components; ++c)
      mean.values[c] = (a.values[c] + b.values[c]) / 2;
    checked.push_back({.estimate = static_cast<double>(estimates[i].*which),
                       .error = std::sqrt(squared_difference(us, mean)),
                       .square = product(us, a, b)});
  }
  return worth_of(std::move(checked));
}

/// Fits the line of one quantity to the compared receivers.
/// @param shaded, other  their results with both variants
template <class QuantityOf>
ErrorLine line_of(std::span<const Pilot> pilots, std::span<const Shading> shaded,
                  std::span<const Shading> other, std::span<const Shading> traced,
                  const QuantityOf& quantity_of) {
  std::vector<double> weights;
  for (const Pilot& pilot : pilots) {
    for (const Compared& one : pilot.compared) weights.push_back(one.weight);
  }
  std::vector<ErrorSample> samples;
  for (std::size_t i = 0; i < shaded.size(); ++i) {
    const Quantity ours = quantity_of(shaded[i]);
    samples.push_back(
        {.squared_difference = squared_difference(ours, quantity_of(other[i])),
         .squared_error = product(ours, quantity_of(traced[2 * i]), quantity_of(traced[2 * i + 1])),
         .weight = weights[i]});
  }
  return fit_errors(samples);
}

}  // namespace

ErrorLine fit_errors(std::span<const ErrorSample> samples) {
  // Sum the moments of differences d and errors e
  double n = 0, d = 0, e = 0, dd = 0, de = 0;
  for (const ErrorSample& s : samples) {
    n += s.weight;
    d += s.weight * s.squared_difference;
    e += s.weight * s.squared_error;
    dd += s.weight * s.squared_difference * s.squared_difference;
    de += s.weight * s.squared_difference * s.squared_error;
  }

  // Fit by least squares; fall back to a flat line where the slope is not positive, and to a line
  // through the origin where the constant is negative
  if (!(e > 0)) return {};
  const ErrorLine flat{.constant = e / n};
  if (!(dd > 0)) return flat;
  const double determinant = n * dd - d * d;
  ErrorLine line;
  if (determinant > 1e-12 * n * dd) {
    line.slope = (n * de - d * e) / determinant;
    line.constant = (e - line.slope * d) / n;
  }
  if (!(line.slope > 0)) return flat;
  if (line.constant < 0) line = {.constant = 0, .slope = e / d};
  return line;
}

std::vector<Shading> trace_pilots(const ContainerReader& scene, const ShadeOptions& options,
                                  std::span<const Pilot> pilots, unsigned rays,
                                  const Executor& executor, Progress& progress,
                                  ReceiverPlaces& compared) {
  const std::vector<Receiver> receivers = compared_of(pilots);
  for (const Receiver& receiver : receivers) compared.add(receiver);
  const std::vector<Receiver> twice = two_of_each(receivers);
  std::vector<Shading> traced(twice.size());
  {
    RayOptions without_sky = ray_options(options);
    without_sky.sky = {};
    RayShader discs(scene, without_sky, executor);
    discs.trace(twice, (rays + 1) / 2, 0, traced, progress);
  }
  return_freed_memory();
  return traced;
}

Estimator::Estimator(const ContainerReader& scene, const ShadeOptions& options,
                     std::span<const Pilot> pilots, std::span<const Shading> traced,
                     const Executor& executor)
    : options_(options),
      cache_(std::make_unique<PageCache>(
          scene, CacheOptions{.memory_bytes = options.cache_bytes,
                              .threads = readers_of(executor, options, true),
                              .back_end = options.back_end})) {
  options_.cache = cache_.get();
  options_.sky = {};  // the sky is not estimated
  options_.variants = std::max(2U, options.variants);
  report_.pilots = traced.size() / 2;
  const double before = cpu_seconds();
  const SceneView view(scene);
  const std::vector<Shading> ours = shade_compared(view, pilots, 0, executor);
  const std::vector<Shading> other = shade_compared(view, pilots, 1, executor);
  report_.cpu_seconds = cpu_seconds() - before;
  occlusion_ = line_of(pilots, ours, other, traced, occlusion_of);
  irradiance_ = line_of(pilots, ours, other, traced, irradiance_of);
  other_ = std::make_unique<Shader>(scene, options_, executor);
}

std::vector<Shading> Estimator::shade_compared(const SceneView& view, std::span<const Pilot> pilots,
                                               unsigned turn, const Executor& executor) const {
  const auto compared = [&](std::size_t i) -> std::span<const Compared> {
    return pilots[i].compared;
  };
  const ShadedPilots shaded = shade_pilots(view, *cache_, options_, options_.gather, pilots,
                                           every_pilot(pilots), compared, executor, turn);
  std::vector<Shading> all;
  for (const auto& some : shaded.results) all.insert(all.end(), some.begin(), some.end());
  return all;
}

std::span<const ErrorEstimate> Estimator::estimate(std::span<const Receiver> receivers,
                                                   std::span<const Shading> results,
                                                   unsigned variant) {
  shaded_.resize(receivers.size());
  estimates_.resize(receivers.size());
  Progress silent;
  const double before = cpu_seconds();
  other_->shade(receivers, shaded_, silent, variant + 1);
  report_.cpu_seconds += cpu_seconds() - before;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const double occlusion = squared_difference(occlusion_of(results[i]), occlusion_of(shaded_[i]));
    const double irradiance =
        squared_difference(irradiance_of(results[i]), irradiance_of(shaded_[i]));
    estimates_[i] = {.occlusion = static_cast<float>(std::sqrt(occlusion_.at(occlusion))),
                     .irradiance = static_cast<float>(std::sqrt(irradiance_.at(irradiance)))};
  }
  return estimates_;
}

EstimateCheck check_estimates(std::span<const ErrorEstimate> estimates,
                              std::span<const Shading> ours, std::span<const Shading> traced) {
  return {
      .occlusion = worth_of(estimates, &ErrorEstimate::occlusion, ours, traced, occlusion_of),
      .irradiance = worth_of(estimates, &ErrorEstimate::irradiance, ours, traced, irradiance_of)};
}

}  // namespace ptc
