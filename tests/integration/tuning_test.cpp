// The requested error, compared with the measured one.
#include "engine/pipeline/quality/tuning.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/candidates.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/quality/pilot_rays.h"
#include "engine/pipeline/run.h"
#include "engine/ptc.h"
#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// A floor, a wall and balls, all of the same radiance.
std::vector<Surfel> lit_balls() {
  return small_scene(0.02);
}

/// Crossed sheets over a floor: edges and backs everywhere.
std::vector<Surfel> crossed_sheets() {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, 0.03, {0.6F, 0.6F, 0.4F});
  for (int i = 0; i < 6; ++i) {
    const double x = -1.5 + 0.6 * i;
    add_rectangle(surfels, {x, -1.5, 0}, {0, 3, 0}, {0.2, 0, 0.9}, 0.03,
                  {0.2F, 0.1F * static_cast<float>(i), 0.7F});
  }
  return surfels;
}

/// Surfels over a floor, all without light.
std::vector<Surfel> dark_balls() {
  std::vector<Surfel> surfels = small_scene(0.03);
  for (Surfel& s : surfels) s.radiance = glm::vec3(0);
  return surfels;
}

/// Returns the error of each setting of the ladder at the receivers of a scene.
std::vector<double> errors_along_ladder(const Scene& scene) {
  std::vector<Pilot> pilots;
  for (std::size_t i = 0; i < scene.receivers.size(); i += 64) {
    const auto first = scene.receivers.begin() + static_cast<std::ptrdiff_t>(i);
    add_pilots(pilots, {first, first + 64}, 0, 1, 1);
  }
  Progress silent;
  std::vector<double> errors;
  for (const RungError& rung :
       climb(*scene.container, {.cache_bytes = 64U << 20}, pilots, 2304, ThreadPool(1), silent)) {
    CHECK(rung.us_per_receiver > 0);
    errors.push_back(rung.error.relative());
  }
  return errors;
}

LightingReport shade_with(const Scene& scene, double error, const RunOptions& run = {},
                          const char* name = "o.ply") {
  ShadeRequest request{{.scene = scene.dir / "scene.ptcx", .error = error, .run = run}};
  request.check = {.receivers = 1000, .rays = 2048};
  Progress silent;
  return shade_container(request, scene.dir / name, silent);
}

}  // namespace

TEST_CASE("error sums: the noise of the rays is separated from the error of the gather",
          "[integration][error]") {
  std::mt19937 bits;
  std::normal_distribution<float> normal;
  ErrorSums sums;
  for (int i = 0; i < 20'000; ++i) {
    const auto rays = [&] {
      return Shading{.occlusion = 0.5F + 0.1F * normal(bits),
                     .irradiance = glm::vec3(2 + 0.2F * normal(bits))};
    };
    const Shading ours{.occlusion = 0.5F + 0.04F + 0.03F * normal(bits),
                       .irradiance = glm::vec3(2.1F)};
    const Shading a = rays(), b = rays();
    sums.add(ours, a, b);
  }
  const CheckError e = sums.error();
  CHECK(e.occlusion_rms == Approx(0.05).epsilon(0.05));
  CHECK(e.occlusion_bias == Approx(0.04).epsilon(0.05));
  CHECK(e.occlusion_mean == Approx(0.5).epsilon(0.01));
  CHECK(e.occlusion_noise == Approx(0.1 / std::sqrt(2)).epsilon(0.03));
  CHECK(e.irradiance_rms == Approx(0.05).epsilon(0.05));
  CHECK(e.relative() == Approx(0.1).epsilon(0.05));
  CHECK(ErrorSums().error().relative() == 0);
}

TEST_CASE("error sums: the errors of two sets together are those of all their receivers",
          "[integration][error]") {
  std::mt19937 bits;
  std::normal_distribution<float> normal;
  ErrorSums first, second, both;
  for (int i = 0; i < 3000; ++i) {
    const bool early = i < 1000;
    const float light = early ? 3.0F : 0.5F;
    const auto rays = [&] {
      return Shading{.occlusion = (early ? 0.2F : 0.7F) + 0.02F * normal(bits),
                     .irradiance = glm::vec3(light * (1 + 0.02F * normal(bits))),
                     .sky = glm::vec3(early ? 1.0F : 0.2F)};
    };
    const Shading ours{.occlusion = (early ? 0.25F : 0.66F) + 0.03F * normal(bits),
                       .irradiance = glm::vec3(light * (early ? 1.1F : 0.8F))};
    const Shading a = rays(), b = rays();
    (early ? first : second).add(ours, a, b);
    both.add(ours, a, b);
  }
  const CheckError e = pooled(first.error(), 1000, second.error(), 2000), all = both.error();
  CHECK(e.occlusion_rms == Approx(all.occlusion_rms).epsilon(1e-6));
  CHECK(e.occlusion_bias == Approx(all.occlusion_bias).epsilon(1e-6));
  CHECK(e.occlusion_mean == Approx(all.occlusion_mean).epsilon(1e-6));
  CHECK(e.occlusion_noise == Approx(all.occlusion_noise).epsilon(1e-6));
  CHECK(e.irradiance_rms == Approx(all.irradiance_rms).epsilon(1e-6));
  CHECK(e.irradiance_bias == Approx(all.irradiance_bias).epsilon(1e-6));
  CHECK(e.irradiance_mean == Approx(all.irradiance_mean).epsilon(1e-6));
  CHECK(e.irradiance_noise == Approx(all.irradiance_noise).epsilon(1e-6));
  CHECK(e.sky_mean == Approx(all.sky_mean).epsilon(1e-6));
}

TEST_CASE("error: where little of the sky is seen, its light is off by more than occlusion",
          "[integration][error]") {
  // 2 % of the sky are open, and occlusion is off by half a percent of itself.
  CheckError e{.occlusion_rms = 0.005, .occlusion_mean = 0.98, .occlusion_noise = 0.001};
  CHECK(e.relative() == Approx(0.005 / 0.98));  // no sky
  e.sky_mean = 0.02;
  CHECK(e.relative() == Approx(0.25));
  CHECK(e.relative_noise() == Approx(0.05));
  e.irradiance_mean = 0.02;  // half of the light comes from surfaces
  CHECK(e.relative() == Approx(0.125));
  e.irradiance_mean = 200;  // a lamp outshines it
  CHECK(e.relative() == Approx(0.005 / 0.98));
  // By rays, over the colours
  ErrorSums sums;
  sums.add({}, {.sky = {1, 2, 3}}, {.sky = {3, 2, 1}});
  sums.add(sums);
  CHECK(sums.error().sky_mean == Approx(2));
}

TEST_CASE("tuning: pilots fit into every run and are a small part of a long one",
          "[integration][error]") {
  constexpr std::size_t kBlock = 4096;
  CHECK(plan_pilots(0, kBlock).blocks == 0);
  for (std::uint64_t n = 1; n < 100'000'000; n += 1 + n / 7) {
    const PilotPlan plan = plan_pilots(n, kBlock);
    CAPTURE(n, plan.blocks, plan.stretches);
    REQUIRE(plan.blocks >= 1);
    REQUIRE((plan.blocks - 1) * kBlock < n);
    REQUIRE(plan.blocks <= 128);
    REQUIRE(plan.blocks * plan.stretches >= 64);
    REQUIRE(plan.blocks * plan.stretches <= 128);
  }
}

TEST_CASE("tuning: a block is cut into pilots that stand for all of it", "[integration][error]") {
  for (const std::size_t size : {1U, 2U, 3U, 15U, 33U, 500U, 4096U}) {
    for (const double phase : {0.0, 0.3, 0.999}) {
      std::vector<Pilot> pilots;
      add_pilots(pilots, std::vector<Receiver>(size), 3, 64, 2.5, phase);
      CAPTURE(size, phase, pilots.size());
      CHECK(pilots.size() ==
            std::min<std::size_t>(
                64, std::max<std::size_t>(std::min<std::size_t>(size, 2), size / 16)));
      std::size_t end = 0;
      double weight = 0;
      for (const Pilot& pilot : pilots) {
        REQUIRE(pilot.begin == end);
        end = pilot.end;
        std::set<std::size_t> places, compared;
        for (const Compared& one : candidates_of(pilot)) {
          places.insert(one.at);
          weight += one.weight;
        }
        for (const Compared& one : pilot.compared) {
          compared.insert(one.at);
          weight += one.weight;
        }
        REQUIRE(places.size() == std::min<std::size_t>(64, pilot.end - pilot.begin));
        REQUIRE(compared.size() == std::min<std::size_t>(8, pilot.end - pilot.begin));
        REQUIRE(*places.begin() >= pilot.begin);
        REQUIRE(*places.rbegin() < pilot.end);
        REQUIRE(*compared.rbegin() < pilot.end);
      }
      CHECK(end == size);
      CHECK(weight == Approx(2 * 2.5 * static_cast<double>(size)));
    }
  }
}

TEST_CASE("tuning: receivers that may be off by much are compared more often, and weigh less",
          "[integration][error]") {
  // One candidate in 64 is a hundred times as bright and as far off as the others
  std::vector<Pilot> pilots;
  std::vector<std::vector<Shading>> coarse, fine;
  std::size_t bright = 0, chosen = 0, all = 0;
  double light = 0, mean = 0, sum = 0;
  for (int i = 0; i < 64; ++i) add_pilots(pilots, std::vector<Receiver>(4096), 0, 1, 1);
  for (std::size_t i = 0; i < pilots.size(); ++i) {
    auto& row = fine.emplace_back();
    coarse.emplace_back(64);
    for (std::size_t k = 0; k < 64; ++k) {
      const float value = (7 * i + 3) % 64 == k ? 100.0F : 1.0F;
      row.push_back({.irradiance = glm::vec3(value)});
      mean += static_cast<double>(value) / 64 / 64;
    }
  }
  choose_compared(pilots, coarse, fine);
  for (std::size_t i = 0; i < pilots.size(); ++i) {
    const std::vector<Compared> candidates = candidates_of(pilots[i]);
    for (const Compared& one : pilots[i].compared) {
      const auto found = std::ranges::find(candidates, one.at, &Compared::at);
      REQUIRE(found != candidates.end());
      const double value = static_cast<double>(
          fine[i][static_cast<std::size_t>(found - candidates.begin())].irradiance.r);
      if (value > 1) ++bright;
      CHECK(one.weight <= 4.01 * 4096 / 8);
      light += one.weight * value;
      sum += one.weight;
      ++chosen;
    }
    all += pilots[i].compared.size();
  }
  CHECK(all == 64 * 8);
  CHECK(bright == 64);  // evenly spread they would be 8
  CHECK(light / sum == Approx(mean).epsilon(0.1));
  CHECK(sum == Approx(64.0 * 4096).epsilon(0.1));
  // Where nothing differs, all have the same chance
  for (auto& row : fine) row.assign(64, {});
  choose_compared(pilots, coarse, fine);
  for (const Pilot& pilot : pilots) {
    CHECK(pilot.compared.size() == 8);
    for (const Compared& one : pilot.compared) CHECK(one.weight == Approx(4096.0 / 8));
  }
}

TEST_CASE("tuning: receivers with more noise get more rays, and the noise is what was asked",
          "[integration][error]") {
  // A small lamp lights a corner of the floor
  std::vector<Surfel> surfels = lit_balls();
  for (Surfel& s : surfels) s.radiance *= 0.1F;
  surfels.push_back({.position = {-1.2, -1.2, 0.15},
                     .normal = {0, 0, -1},
                     .radius = 0.06F,
                     .radiance = glm::vec3(20)});
  Scene scene(surfels);
  add_floor_receivers(scene.receivers, 0.02);
  std::vector<Pilot> pilots;
  for (std::size_t i = 0; i < scene.receivers.size(); i += 64) {
    const auto first = scene.receivers.begin() + static_cast<std::ptrdiff_t>(i);
    add_pilots(pilots, {first, first + 64}, 0, 1, 1);
  }
  const ThreadPool executor(1);
  Progress silent;
  RayShader discs(*scene.container, {.memory_bytes = 64U << 20}, executor);
  const auto noise = [&](const PilotRays& rays) {
    ErrorSums sums;
    for (std::size_t i = 0; i < rays.compared.size(); ++i)
      sums.add(rays.traced[2 * i], rays.traced[2 * i], rays.traced[2 * i + 1]);
    return std::sqrt(2) * sums.error().relative_noise();
  };
  const PilotRays few = trace_evenly(pilots, 256, discs, silent);
  const double asked = noise(few) / 3;
  const PilotRays enough = trace_for(pilots, asked, discs, silent);
  CAPTURE(noise(few), asked, noise(enough), enough.rays);
  CHECK(noise(enough) < 1.3 * asked);
  CHECK(noise(enough) > 0.3 * asked);
  const PilotRays even = trace_evenly(pilots, static_cast<unsigned>(enough.rays), discs, silent);
  CHECK(noise(enough) < 0.8 * noise(even));
  CHECK(few.rays_for(noise(few)) == Approx(256));
  // Where few rays are enough, they are all
  const PilotRays same = trace_for(pilots, 1.01 * noise(few), discs, silent);
  CHECK(same.rays == 256);
  CHECK(same.traced[5].irradiance == few.traced[5].irradiance);
}

TEST_CASE("tuning: the error falls along the ladder", "[integration][error]") {
  for (const bool sheets : {false, true}) {
    Scene scene(sheets ? crossed_sheets() : lit_balls());
    add_floor_receivers(scene.receivers, 0.02);
    REQUIRE(scene.receivers.size() % 64 == 0);
    const std::vector<double> errors = errors_along_ladder(scene);
    REQUIRE(errors.size() == ladder().size());
    CAPTURE(sheets, errors);
    for (std::size_t i = 2; i < errors.size(); ++i)
      CHECK(errors[i] <= 1.05 * errors[i - 2] + 0.002);
    CHECK(errors.back() < errors.front() / 5);
    CHECK(errors.back() > 0);
  }
  for (std::size_t i = 1; i < ladder().size(); ++i)
    CHECK(ladder()[i].usual_error < ladder()[i - 1].usual_error);
}

TEST_CASE("tuning: a requested error is met at receivers that did not choose the setting",
          "[integration][error]") {
  for (const auto& surfels : {lit_balls(), crossed_sheets(), dark_balls()}) {
    const Scene scene(surfels);
    unsigned setting = 0;
    for (const double asked : {0.1, 0.05, 0.03}) {
      const LightingReport report = shade_with(scene, asked);
      REQUIRE(report.tuning);
      CAPTURE(asked, report.tuning->setting, report.tuning->measured.relative());
      CHECK(report.tuning->met);
      CHECK(report.tuning->receiver_rays == 0);  // neighbours share what the gather finds
      CHECK(report.check->discs.relative() <= asked);
      CHECK(report.tuning->setting >= setting);
      setting = report.tuning->setting;
    }
    CHECK(setting + 1 < ladder().size());
  }
}

TEST_CASE("tuning: an error that no setting meets takes the finest setting and reports its error",
          "[integration][error]") {
  const Scene scene(lit_balls());
  const LightingReport report = shade_with(scene, 1e-4);
  CHECK_FALSE(report.tuning->met);
  CHECK(report.tuning->setting == ladder().size() - 1);
  CHECK(report.tuning->measured.relative() > 1e-4);
  CHECK(report.check->discs.relative() == Approx(report.tuning->measured.relative()).epsilon(0.5));
}

TEST_CASE("tuning: neither threads nor the cap change the choice or any byte",
          "[integration][error]") {
  const Scene scene(lit_balls());
  const auto bytes = [&](const char* name) { return bytes_of(scene.dir / name); };
  const LightingReport one =
      shade_with(scene, 0.04, {.memory_bytes = std::uint64_t{1} << 30, .threads = 1}, "one.ptcx");
  const LightingReport two =
      shade_with(scene, 0.04, {.memory_bytes = std::uint64_t{81} << 20, .threads = 2}, "two.ptcx");
  CHECK(one.tuning->setting == two.tuning->setting);
  CHECK(one.tuning->measured.relative() == two.tuning->measured.relative());
  CHECK(bytes("one.ptcx") == bytes("two.ptcx"));
  const LightingReport other = shade_with(scene, 0.1, {}, "other.ptcx");
  CHECK(other.tuning->setting < one.tuning->setting);
  CHECK(bytes("other.ptcx") != bytes("one.ptcx"));
}

TEST_CASE("tuning: receivers far apart are shaded by rays where these cost less",
          "[integration][error]") {
  TemporaryDirectory dir;
  Progress silent;
  static_cast<void>(build_container({.city_points = 600'000}, dir.path() / "city.ptcx", silent));
  const auto shade = [&](double error, const RunOptions& run, const char* name) {
    ShadeRequest request{{.scene = dir.path() / "city.ptcx", .error = error, .run = run}};
    request.count = 1500;
    request.check = {.receivers = 400, .rays = 4096};
    return shade_container(request, dir.path() / name, silent);
  };
  const LightingReport one =
      shade(0.02, {.memory_bytes = std::uint64_t{1} << 30, .threads = 1}, "one.ply");
  REQUIRE(one.tuning->receiver_rays > 0);
  CHECK(one.tuning->met);
  CHECK(one.receivers == 1500);
  CHECK(one.gather.receivers == 0);
  CHECK(one.cache.misses > 0);
  CHECK(one.tuning->measured.relative() <= 0.02);
  CHECK(one.check->discs.relative() <= 1.2 * 0.02);
  CHECK(one.check->discs.relative() >= 0.3 * 0.02);  // not the rays that it is compared with
  // A container of the receivers records it
  ShadeRequest again{{.scene = dir.path() / "city.ptcx", .error = 0.02}};
  again.receivers = dir.path() / "one.ply";
  const unsigned rays =
      shade_container(again, dir.path() / "again.ptcx", silent).tuning->receiver_rays;
  CHECK(rays > 0);
  CHECK(ContainerReader(dir.path() / "again.ptcx")
            .meta()
            .text.at("shading")
            .starts_with("rays " + std::to_string(rays) + " sides both"));
  // Neither threads nor the cap change a byte
  const LightingReport two =
      shade(0.02, {.memory_bytes = std::uint64_t{81} << 20, .threads = 2}, "two.ply");
  CHECK(two.tuning->receiver_rays == one.tuning->receiver_rays);
  CHECK(bytes_of(dir.path() / "one.ply") == bytes_of(dir.path() / "two.ply"));
  // Rays would find but a few pixels of a picture of the sky
  ShadeRequest lit{{.scene = dir.path() / "city.ptcx", .error = 0.02}};
  lit.count = 1500;
  lit.sky = Sky{.radiance = glm::vec3(1),
                .map = std::make_shared<const Texture>(
                    Image{.width = 2, .height = 1, .pixels = {glm::vec3(1), glm::vec3(2)}})};
  CHECK(shade_container(lit, dir.path() / "lit.ply", silent).tuning->receiver_rays == 0);
  // A coarse gather costs less
  CHECK(shade(0.2, {}, "coarse.ply").tuning->receiver_rays == 0);
}

TEST_CASE("tuning: runs with few receivers and scenes with few surfels have pilots, too",
          "[integration][error]") {
  const Scene scene(lit_balls());
  for (const std::uint64_t count : {1U, 2U, 5U, 40U}) {
    ShadeRequest request{{.scene = scene.dir / "scene.ptcx", .error = 0.1}};
    request.count = count;
    Progress silent;
    const LightingReport report = shade_container(request, scene.dir / "few.ply", silent);
    CHECK(report.tuning->pilots >= 1);
    CHECK(report.tuning->pilots <= count);
  }
  const Scene empty({});
  const LightingReport report = shade_with(empty, 0.1);
  CHECK(report.receivers == 0);
  CHECK(report.tuning->met);
  CHECK(report.tuning->setting == 0);
}
