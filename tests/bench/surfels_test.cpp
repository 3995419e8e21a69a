#include "tools/bench/experiments/surfels.h"

#include <cmath>

#include <catch2/catch.hpp>

using namespace ptc;
using namespace ptc::bench;

TEST_CASE("surfels: what keeps an error lies on the lines between the containers", "[bench]") {
  const auto trial = [](std::uint64_t points, double error) {
    return SurfelTrial{.points = points,
                       .bytes = 10 * points,
                       .found = {.error = {.irradiance_rms = error, .irradiance_mean = 1}}};
  };
  // An error that goes with the root of one over the number
  const std::vector<SurfelTrial> trials{trial(1'000, 0.08), trial(4'000, 0.04), trial(16'000, 0.02),
                                        trial(64'000, 0.05)};
  const SurfelsNeed need = need_of(trials, 0.03);
  CHECK(need.surfels == Approx(4'000 * 16.0 / 9));
  CHECK(need.bytes == Approx(40'000 * 16.0 / 9));
  CHECK(need_of(trials, 0.04).surfels == Approx(4'000));
  CHECK(need_of(trials, 0.1).surfels == Approx(1'000));
  CHECK(std::isnan(need_of(trials, 0.01).surfels));
  CHECK(std::isnan(need_of({}, 0.01).bytes));
  CHECK(need_of({trial(1'000, 0.08), trial(4'000, 0)}, 0.03).surfels == Approx(4'000));
}
