#include "tools/bench/references/reference.h"

#include "tools/bench/chart/statistics.h"

namespace ptc::bench {

std::vector<float> occlusion_of(std::span<const Shading> shadings) {
  std::vector<float> values;
  for (const Shading& s : shadings) values.push_back(s.occlusion);
  return values;
}

std::vector<float> irradiance_of(std::span<const Shading> shadings) {
  std::vector<float> values;
  for (const Shading& s : shadings) {
    values.insert(values.end(), {s.irradiance.r, s.irradiance.g, s.irradiance.b});
  }
  return values;
}

double relative_rms(std::span<const float> ours, std::span<const float> reference) {
  return over_mean(error_statistics(ours, reference)).rms;
}

Reference make_reference(const ReceiverSet& set, const Checked& checked, const ReferenceRays& rays,
                         const TraceOne& trace, const Executor& executor) {
  const auto trace_all = [&](const std::vector<std::size_t>& indices, unsigned count,
                             std::uint64_t salt) {
    std::vector<Shading> results(indices.size());
    executor.for_each(indices.size(), [&](std::size_t i, unsigned) {
      results[i] = trace(set.receivers[indices[i]], count, salt + indices[i]);
    });
    return results;
  };
  // Trace the two halves, and the window
  constexpr std::uint64_t kFirst = std::uint64_t{1} << 40, kSecond = std::uint64_t{2} << 40;
  const std::vector<Shading> a = trace_all(checked.receivers, rays.half, kFirst);
  const std::vector<Shading> b = trace_all(checked.receivers, rays.half, kSecond);
  // Take the mean of the halves
  Reference reference;
  if (rays.window > 0) reference.window = trace_all(checked.window, rays.window, kFirst);
  for (std::size_t i = 0; i < a.size(); ++i) {
    Shading s;
    s.occlusion = 0.5F * (a[i].occlusion + b[i].occlusion);
    s.irradiance = 0.5F * (a[i].irradiance + b[i].irradiance);
    reference.mean.push_back(s);
  }
  // The halves differ by sqrt(2) times the error of one half, and the error of their mean is that
  // error over sqrt(2): half of their difference.
  reference.occlusion_noise = 0.5 * relative_rms(occlusion_of(a), occlusion_of(b));
  reference.irradiance_noise = 0.5 * relative_rms(irradiance_of(a), irradiance_of(b));
  return reference;
}

}  // namespace ptc::bench
