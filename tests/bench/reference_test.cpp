// References that report their own error, and pictures that are compared.
#include "tools/bench/references/reference.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/parallel/thread_pool.h"
#include "tools/bench/experiments/window.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

/// Returns a number that is evenly spread in [-1, 1).
float noise(std::uint64_t seed) {
  return 2 * to_unit(static_cast<std::uint32_t>(splitmix64(seed) >> 32)) - 1;
}

/// A window of 16 x 16 pixels in which every fourth pixel sees nothing.
ReceiverSet windowed_set() {
  ReceiverSet set{.name = "camera", .window_width = 16, .window_height = 16};
  for (std::size_t i = 0; i < 256; ++i) {
    const bool seen = i % 4 != 0;
    set.window.push_back(
        {.receiver = seen ? set.receivers.size() : ReceiverSet::kNone, .albedo = glm::vec3(0.5F)});
    if (seen) set.receivers.push_back({});
  }
  return set;
}

}  // namespace

TEST_CASE("reference: the error that it reports of itself is right", "[bench][reference]") {
  constexpr std::size_t kCount = 20'000;
  ReceiverSet set{.receivers = std::vector<Receiver>(kCount)};
  Checked checked;
  for (std::size_t i = 0; i < kCount; ++i) checked.receivers.push_back(i);
  const auto trace = [](const Receiver&, unsigned rays, std::uint64_t seed) {
    CHECK(rays == 64);
    CHECK(seed >= std::uint64_t{1} << 40);
    Shading s;
    s.occlusion = 0.5F + 0.1F * noise(seed);
    s.irradiance = glm::vec3(3 + 0.5F * noise(seed + kCount));
    return s;
  };
  const Reference reference = make_reference(set, checked, {.half = 64}, trace, ThreadPool(1));
  CHECK(reference.window.empty());
  const std::vector<float> truth(kCount, 0.5F), light(3 * kCount, 3.0F);
  CHECK(reference.occlusion_noise ==
        Approx(relative_rms(occlusion_of(reference.mean), truth)).epsilon(0.03));
  CHECK(reference.irradiance_noise ==
        Approx(relative_rms(irradiance_of(reference.mean), light)).epsilon(0.03));
  CHECK(reference.occlusion_noise == Approx(0.2 / std::sqrt(6.0)).epsilon(0.03));
}

TEST_CASE("reference: the window has its own rays", "[bench][reference]") {
  ReceiverSet set{.receivers = std::vector<Receiver>(5)};
  const Checked checked{.receivers = {1, 3}, .window = {0, 2, 4}};
  const auto trace = [](const Receiver&, unsigned rays, std::uint64_t) {
    return Shading{.occlusion = static_cast<float>(rays)};
  };
  const Reference reference =
      make_reference(set, checked, {.half = 64, .window = 16}, trace, ThreadPool(1));
  CHECK(occlusion_of(reference.mean) == std::vector<float>{64, 64});
  CHECK(occlusion_of(reference.window) == std::vector<float>{16, 16, 16});
}

TEST_CASE("window: a picture differs from others, but not from itself", "[bench][window]") {
  const ReceiverSet set = windowed_set();
  const std::vector<Shading> dark(set.receivers.size(),
                                  {.occlusion = 0.9F, .irradiance = glm::vec3(0.1F)});
  std::vector<Shading> other = dark;
  other[70].irradiance = {3, 0, 0};
  other[70].occlusion = 0.1F;
  for (const Quantity job : {Quantity::occlusion, Quantity::bleeding}) {
    CHECK(window_flip(set, dark, dark, job, glm::vec3(0)) == 0);
    CHECK(window_flip(set, other, dark, job, glm::vec3(0)) > 0.001);
  }
}

TEST_CASE("window: exposure makes dark pictures as bright as others", "[bench][window]") {
  const ReceiverSet set = windowed_set();
  const auto flip_at = [&](float light) {
    std::vector<Shading> ours(set.receivers.size()), theirs = ours;
    for (std::size_t i = 0; i < ours.size(); ++i) {
      theirs[i].irradiance = glm::vec3(light * (1 + static_cast<float>(i % 7)));
      ours[i].irradiance = theirs[i].irradiance * (1 + 0.2F * noise(i));
    }
    return window_flip(set, ours, theirs, Quantity::bleeding, glm::vec3(0));
  };
  CHECK(flip_at(1) > 0.01);
  CHECK(flip_at(1e-4F) == Approx(flip_at(1)).epsilon(1e-3));
  CHECK(flip_at(1e4F) == Approx(flip_at(1)).epsilon(1e-3));
}

TEST_CASE("window: without a window the difference is NaN, for a black one it is 0",
          "[bench][window]") {
  CHECK(std::isnan(window_flip({}, {}, {}, Quantity::occlusion, glm::vec3(1))));
  ReceiverSet nothing{.window_width = 4, .window_height = 4};
  nothing.window.resize(16, {.receiver = ReceiverSet::kNone});
  CHECK(window_flip(nothing, {}, {}, Quantity::bleeding, glm::vec3(1)) == 0);
}
