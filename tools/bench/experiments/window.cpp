#include "tools/bench/experiments/window.h"

#include <algorithm>
#include <limits>
#include <numbers>

#include "tools/bench/chart/flip.h"

namespace ptc::bench {
namespace {

/// The picture of the window: 1 - occlusion in grey, or direct and gathered light times `gain`.
Image picture(const ReceiverSet& set, std::span<const Shading> shadings, Quantity job,
              const glm::vec3& sky, float gain) {
  Image image{.width = set.window_width, .height = set.window_height};
  std::size_t next = 0;
  for (const Pixel& pixel : set.window) {
    if (pixel.receiver == ReceiverSet::kNone) {
      image.pixels.emplace_back(0.0F);
      continue;
    }
    const Shading& s = shadings[next++];
    if (job == Quantity::occlusion) {
      image.pixels.emplace_back(1 - s.occlusion);
    } else {
      const glm::vec3 arriving =
          s.irradiance * std::numbers::inv_pi_v<float> + sky * (1 - s.occlusion);
      image.pixels.push_back(gain * (pixel.direct + pixel.albedo * arriving));
    }
  }
  return image;
}

/// The gain at which all but the brightest fiftieth of the pixels are at most 1.
float exposure(const Image& image) {
  std::vector<float> values;
  for (const glm::vec3& p : image.pixels) values.push_back(std::max({p.r, p.g, p.b}));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 49 / 50);
  std::ranges::nth_element(values, at);
  return *at > 0 ? 1 / *at : 1;
}

}  // namespace

double window_flip(const ReceiverSet& set, std::span<const Shading> ours,
                   std::span<const Shading> reference, Quantity job, const glm::vec3& sky) {
  if (set.window.empty()) return std::numeric_limits<double>::quiet_NaN();
  const float gain =
      job == Quantity::occlusion ? 1 : exposure(picture(set, reference, job, sky, 1));
  return mean_flip(picture(set, ours, job, sky, gain), picture(set, reference, job, sky, gain));
}

}  // namespace ptc::bench
