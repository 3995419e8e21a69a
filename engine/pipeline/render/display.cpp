#include "engine/pipeline/render/display.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>

namespace ptc {
namespace {

constexpr float kMost = 1e18F;       // its square is still a finite float
constexpr double kGrey = 0.18;       // what the mean of the picture becomes, at least
constexpr double kBright = 0.9;      // what its bright pixels become, at least
constexpr double kShare = 1 / 200.;  // of pixels that may be brighter than those

}  // namespace

Display Display::at_exposure(float stops) noexcept {
  return {.gain = std::exp2(stops)};
}

void Display::show(std::span<glm::vec3> light) const noexcept {
  const float curve = 1 / (white * white);
  for (glm::vec3& pixel : light) {
    pixel = glm::min(pixel * gain, kMost);
    if (white > 1) pixel *= (1.0F + curve * pixel) / (1.0F + pixel);
  }
}

void ExposureMeter::add(std::span<const glm::vec3> light) noexcept {
  for (const glm::vec3& pixel : light) {
    const float most = std::max({pixel.x, pixel.y, pixel.z});
    if (!(most > 0) || !std::isfinite(most)) continue;
    const double logarithm = std::clamp(std::log2(static_cast<double>(most)),
                                        kFirst / double{kSteps}, kLast / double{kSteps});
    ++bins_[static_cast<std::size_t>(std::lround(logarithm * kSteps) - kFirst)];
    ++pixels_;
    logarithms_ += logarithm;
  }
}

Display ExposureMeter::display() const noexcept {
  if (pixels_ == 0) return {};
  // Find the bin above which few pixels lie
  const auto few = static_cast<std::uint64_t>(kShare * static_cast<double>(pixels_));
  std::uint64_t above = 0;
  std::size_t bin = bins_.size() - 1;
  while (above + bins_[bin] <= few) above += bins_[bin--];
  // The upper end of that bin
  const double bright = std::exp2((static_cast<double>(bin) + kFirst + 0.5) / kSteps);
  const double mean = std::exp2(logarithms_ / static_cast<double>(pixels_));
  const double gain = std::max(kGrey / mean, kBright / bright);
  return {static_cast<float>(gain), static_cast<float>(std::max(1.0, gain * bright))};
}

}  // namespace ptc
