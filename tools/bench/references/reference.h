// What methods are compared with: very many rays, in two halves that tell their own error.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "tools/bench/references/methods.h"

namespace ptc::bench {

[[nodiscard]] std::vector<float> occlusion_of(std::span<const Shading> shadings);
/// RGB, one after the other.
[[nodiscard]] std::vector<float> irradiance_of(std::span<const Shading> shadings);
/// RMS of ours - reference over the reference's mean.
[[nodiscard]] double relative_rms(std::span<const float> ours, std::span<const float> reference);

struct Reference {
  std::vector<Shading> mean;    ///< of the two halves, one for each receiver checked
  std::vector<Shading> window;  ///< of rays of its own, one for each pixel that sees something
  double occlusion_noise = 0, irradiance_noise = 0;  ///< RMS of the mean's own error, over its mean
};

struct ReferenceRays {
  unsigned half = 0;    ///< for each receiver checked, twice
  unsigned window = 0;  ///< for each pixel of the window; 0: no window
};

using TraceOne = std::function<Shading(const Receiver&, unsigned rays, std::uint64_t seed)>;

/// Seeds are 2^40 and more: methods take others.
[[nodiscard]] Reference make_reference(const ReceiverSet& set, const Checked& checked,
                                       const ReferenceRays& rays, const TraceOne& trace,
                                       const Executor& executor);

}  // namespace ptc::bench
