// Times at equal error, on numbers made by hand.
#include "tools/bench/experiments/rivals.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

using namespace ptc::bench;

namespace {

AccuracyRow row(const std::string& method, const std::string& setting, Quantity job, double us,
                double rms) {
  AccuracyRow made{
      .method = method, .setting = setting, .job = job, .us_per_receiver = {us, us, us}};
  (job == Quantity::occlusion ? made.occlusion : made.irradiance).rms = rms;
  return made;
}

}  // namespace

TEST_CASE("time at an error: a power law is interpolated exactly", "[bench][rivals]") {
  // Four times the time halves the error.
  const auto law = [](double error) { return 3 / (error * error); };
  std::vector<TimedError> measured;
  for (const double error : {0.4, 0.013, 0.1, 0.05}) measured.push_back({error, law(error)});
  for (double error = 0.013; error <= 0.4; error *= 1.03) {
    CHECK(time_at(measured, error) == Approx(law(error)).epsilon(1e-9));
  }
}

TEST_CASE("time at an error: at a measured error it is the measured time", "[bench][rivals]") {
  const std::vector<TimedError> measured{{0.1, 7}, {0.03, 31}, {0.01, 90}};
  for (const TimedError& m : measured) CHECK(time_at(measured, m.error) == m.us);
  CHECK(time_at({{0.1, 7}}, 0.1) == 7);
}

TEST_CASE("time at an error: there is none outside the measured errors", "[bench][rivals]") {
  const std::vector<TimedError> measured{{0.1, 7}, {0.01, 90}};
  for (const double error :
       {0.1001, 0.00999, 0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(std::isnan(time_at(measured, error)));
  }
  CHECK(std::isnan(time_at({}, 0.1)));
  CHECK(std::isnan(time_at({{std::numeric_limits<double>::quiet_NaN(), 7}}, 0.1)));
}

TEST_CASE("time at an error: the nearest errors count where errors do not fall with time",
          "[bench][rivals]") {
  const std::vector<TimedError> measured{{0.1, 1}, {0.02, 10}, {0.04, 20}, {0.01, 40}};
  CHECK(time_at(measured, 0.04) == 20);
  CHECK(time_at(measured, std::sqrt(0.02 * 0.04)) == Approx(std::sqrt(10.0 * 20)));
}

TEST_CASE("packets: the faster of single rays and packets is kept, in its place",
          "[bench][rivals]") {
  std::vector<AccuracyRow> rows{
      row("ptcx", "0.01 sr, 0.1 rad, R 32", Quantity::occlusion, 50, 0.01),
      row("ptcx", "0.01 sr, 0.1 rad, R 32", Quantity::bleeding, 50, 0.02),
      row("embree-discs", "64 rays, single", Quantity::occlusion, 20, 0.1),
      row("embree-discs", "64 rays, single", Quantity::bleeding, 25, 0.2),
      row("embree-discs", "64 rays, packets", Quantity::occlusion, 15, 0.1),
      row("embree-discs", "64 rays, packets", Quantity::bleeding, 30, 0.2),
      row("embree-discs", "128 rays, single", Quantity::occlusion, 40, 0.05),
      row("embree-mesh", "64 rays, single", Quantity::occlusion, 10, 0.1),
      row("embree-mesh", "64 rays, packets", Quantity::occlusion, 10, 0.1)};
  keep_faster_packets(rows);
  std::vector<std::string> kept;
  for (const AccuracyRow& r : rows)
    kept.push_back(r.method + ": " + r.setting + ": " + name_of(r.job));
  CHECK(kept == std::vector<std::string>{"ptcx: 0.01 sr, 0.1 rad, R 32: occlusion",
                                         "ptcx: 0.01 sr, 0.1 rad, R 32: bleeding",
                                         "embree-discs: 64 rays, packets: occlusion",
                                         "embree-discs: 64 rays, single: bleeding",
                                         "embree-discs: 128 rays, single: occlusion",
                                         "embree-mesh: 64 rays, single: occlusion"});
}

TEST_CASE("speedups: a speedup is the rival's time at a row's error over the row's time",
          "[bench][rivals]") {
  std::vector<AccuracyRow> rows{row("ptcx", "a", Quantity::occlusion, 10, 0.02),
                                row("ptcx", "a", Quantity::bleeding, 10, 0.04),
                                row("ptcx", "b", Quantity::occlusion, 100, 0.001),
                                row("embree-discs", "64 rays", Quantity::occlusion, 20, 0.04),
                                row("embree-discs", "256 rays", Quantity::occlusion, 80, 0.01),
                                row("embree-discs", "64 rays", Quantity::bleeding, 30, 0.04),
                                row("embree-mesh", "64 rays", Quantity::occlusion, 5, 0.02)};
  set_speedups(rows);
  CHECK(rows[0].speedup_discs == Approx(4));
  CHECK(rows[0].speedup_mesh == Approx(0.5));
  CHECK(rows[1].speedup_discs == Approx(3));
  CHECK(std::isnan(rows[1].speedup_mesh));
  CHECK(std::isnan(rows[2].speedup_discs));
  CHECK(rows[4].speedup_discs == Approx(1));
  CHECK(rows[6].speedup_discs == Approx(40.0 / 5));
}
