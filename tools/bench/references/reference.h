// What methods are compared with: very many rays, in two halves whose difference gives the error of
// the reference itself.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "tools/bench/references/methods.h"

namespace ptc::bench {

/// The occlusion of each shading.
[[nodiscard]] std::vector<float> occlusion_of(std::span<const Shading> shadings);
/// The irradiance of each shading as three numbers: red, green, blue.
[[nodiscard]] std::vector<float> irradiance_of(std::span<const Shading> shadings);
/// The root mean square of ours - reference, divided by the reference's mean.
[[nodiscard]] double relative_rms(std::span<const float> ours, std::span<const float> reference);

/// Shadings that count as the truth, and how far they are from it themselves.
struct Reference {
  std::vector<Shading> mean;    ///< mean of the two halves for each checked receiver
  std::vector<Shading> window;  ///< shading of each pixel that sees something, by other rays
  /// RMS error of `mean` itself, as a share of its mean value.
  double occlusion_noise = 0, irradiance_noise = 0;
};

/// How many rays a reference takes.
struct ReferenceRays {
  unsigned half = 0;    ///< rays of each of the two halves, for each receiver checked
  unsigned window = 0;  ///< rays for each pixel of the window; 0: no window
};

/// Shades one receiver by this many rays of this seed.
using TraceOne = std::function<Shading(const Receiver&, unsigned rays, std::uint64_t seed)>;

/// Traces a reference for the checked receivers and the window. Its seeds are 2^40 and more, so
/// that they differ from those of all methods.
[[nodiscard]] Reference make_reference(const ReceiverSet& set, const Checked& checked,
                                       const ReferenceRays& rays, const TraceOne& trace,
                                       const Executor& executor);

}  // namespace ptc::bench
