// How many surfels a mesh needs: the error of a container against its mesh, and the choice by it.
#include "engine/pipeline/quality/surfel_choice.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/quality/surface_error.h"
#include "engine/trace/ray_shader.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Writes a ball of radius 1 above a ground of 8 x 8 as OBJ.
/// @param gap   between the ball and the ground
void write_ball(const std::filesystem::path& path, int rings, double gap) {
  std::ofstream out(path);
  out << "v -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3 4\n";
  const int around = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int k = 0; k < around; ++k) {
      const double down = M_PI * i / rings, turn = 2 * M_PI * k / around;
      out << "v " << std::sin(down) * std::cos(turn) << ' ' << 1 + gap + std::cos(down) << ' '
          << std::sin(down) * std::sin(turn) << '\n';
    }
  }
  for (int i = 0; i < rings; ++i) {
    for (int k = 0; k < around; ++k) {
      const int a = 5 + i * around + k, b = 5 + i * around + (k + 1) % around;
      out << "f " << a << ' ' << b << ' ' << b + around << ' ' << a + around << '\n';
    }
  }
}

BuildRequest request_for(const std::filesystem::path& mesh) {
  BuildRequest request;
  request.inputs = {mesh};
  request.one_sided = true;
  return request;
}

SurfelChoice choose(const BuildRequest& request, double asked, const std::filesystem::path& there) {
  StageSeconds seconds;
  Progress silent;
  return choose_surfels(request, asked, there / "o.ptcx", seconds, silent);
}

}  // namespace

TEST_CASE("surfel choice: errors of which both sides come from rays leave their noise out",
          "[integration][error]") {
  // What is ours has the noise of the truth, and is off by 0.1 of occlusion and by 0.2 of light
  std::vector<ErrorSums> parts(400);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const float a = 0.3F * std::sin(static_cast<float>(i)),
                b = 0.3F * std::cos(2.3F * static_cast<float>(i));
    const auto of = [](float noise, float error) {
      return Shading{.occlusion = 0.5F + noise + error / 2,
                     .irradiance = glm::vec3(1 + noise + error)};
    };
    parts[i].add(of(a, 0.2F), of(a, 0), of(b, 0.2F), of(b, 0));
  }
  const BoundedError found = bounded_error(parts);
  CHECK(found.error.occlusion_rms == Approx(0.1).epsilon(1e-4));
  CHECK(found.error.irradiance_rms == Approx(0.2 / found.error.irradiance_mean).epsilon(1e-4));
  CHECK(found.error.irradiance_bias == Approx(found.error.irradiance_rms).epsilon(1e-4));
  CHECK(found.error.irradiance_noise < 1e-4);
  CHECK(found.low <= found.error.relative());
  CHECK(found.error.relative() <= found.high);
  CHECK(bounded_error({}).high == 0);
}

TEST_CASE("surfel choice: the error of a container is that of a formula, where there is one",
          "[integration][error]") {
  // Occlusion of the ground before a ball, as a camera sees it: the share of a half space that a
  // ball covers is cos / distance^2
  const TemporaryDirectory scratch;
  const auto mesh = scratch.path() / "ball.obj", target = scratch.path() / "o.ptcx";
  constexpr double kGap = 0.05;
  write_ball(mesh, 64, kGap);
  BuildRequest request = request_for(mesh);
  request.sampling.count = 2'000;
  request.sampling.pixels_per_surfel = 1'000;  // nothing is sampled more finely for it
  request.sampling.camera =
      Camera{.position = {1.5, 1, 0}, .look_at = {1, 0, 0}, .width = 300, .height = 200};
  Progress silent;
  build_container(request, target, silent);
  const ThreadPool executor(2);
  const ContainerReader scene(target);
  const BoundedError told = SurfaceJudge(request, target, executor).measure(scene);

  std::vector<Receiver> receivers;
  std::vector<double> truth;
  for (int i = 0; i < 3'000; ++i) {
    const double u = std::fmod(0.5 + i * 0.7548776662, 1.0),
                 v = std::fmod(0.5 + i * 0.5698402910, 1.0);
    const Camera& camera = *request.sampling.camera;
    const glm::dvec3 way(
        camera.direction(300 * static_cast<float>(u), 200 * static_cast<float>(v)));
    if (way.y >= 0) continue;
    const glm::dvec3 at = camera.position - way * (camera.position.y / way.y);
    const glm::dvec3 to = glm::dvec3(0, 1 + kGap, 0) - at;
    const double distance = glm::length(to);
    if (glm::dot(camera.position - at, to) > 0 && glm::length(to - way * glm::dot(to, way)) < 1) {
      continue;  // the ball hides it
    }
    truth.push_back(to.y / distance / (distance * distance));
    receivers.push_back({at + glm::dvec3(0, 0.02, 0), {0, 1, 0}});
  }
  REQUIRE(receivers.size() > 2'000);
  RayShader discs(scene, {}, executor);
  std::vector<Shading> traced(receivers.size());
  discs.trace(receivers, 4'096, 99, traced, silent);
  double square = 0, mean = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    square += std::pow(static_cast<double>(traced[i].occlusion) - truth[i], 2);
    mean += truth[i] / static_cast<double>(truth.size());
  }
  const double rms = std::sqrt(square / static_cast<double>(truth.size()));
  CHECK(told.error.occlusion_mean == Approx(mean).epsilon(0.02));
  CHECK(told.error.occlusion_rms == Approx(rms).epsilon(0.25));
  CHECK(told.error.occlusion_rms > 0.002);
  // The rays at the surfels go where those at the mesh go, and share noise: others have 0.0044
  CHECK(told.error.occlusion_noise < 0.0036);
}

TEST_CASE("surfel choice: it takes about the fewest surfels that meet what is asked",
          "[integration][error]") {
  const TemporaryDirectory scratch;
  const auto mesh = scratch.path() / "ball.obj", target = scratch.path() / "o.ptcx";
  write_ball(mesh, 48, 0.05);
  const BuildRequest request = request_for(mesh);
  const SurfelChoice choice = choose(request, 0.04, scratch.path());
  REQUIRE(choice.met);
  CHECK(choice.taken.found.high <= 0.04);
  CHECK(choice.taken.found.error.relative() > 0.01);
  const auto best = std::ranges::find_if(choice.trials, [&](const SurfelTrial& trial) {
    return trial.adapts == choice.taken.adapts && trial.found.high > 0.04 &&
           1.25 * static_cast<double>(trial.count) > static_cast<double>(choice.taken.count);
  });
  CHECK(best != choice.trials.end());
  // Nothing stays behind, and a build with the choice is what was measured
  CHECK(std::distance(std::filesystem::directory_iterator(scratch.path()), {}) == 1);
  BuildRequest chosen = request;
  chosen.sampling.count = choice.taken.count;
  chosen.sampling.adapts = choice.taken.adapts;
  Progress silent;
  const BuildReport report = build_container(chosen, target, silent);
  CHECK(report.superblock.points == choice.taken.points);
  CHECK(report.superblock.file_bytes == choice.taken.bytes);
  // A looser error takes fewer, a tighter one more, whatever the threads
  CHECK(choose(request, 0.1, scratch.path()).taken.count < choice.taken.count);
  BuildRequest alone = request;
  alone.run.threads = 1;
  alone.run.memory_bytes = std::uint64_t{300} << 20;
  const SurfelChoice again = choose(alone, 0.04, scratch.path());
  CHECK(again.taken.count == choice.taken.count);
  CHECK(again.taken.found.high == choice.taken.found.high);
}

TEST_CASE("surfel choice: the search meets what is asked, and knows when nothing does",
          "[integration][error]") {
  // Errors as meshes have them: they fall with a power of the number to a floor, and scatter
  const auto model = [](double first, double power, double floor, double gain) {
    return [=](std::uint64_t count, bool adapts) {
      const double scatter = 1 + 0.1 * std::sin(static_cast<double>(count));
      const double off = scatter * (adapts ? gain : 1) * first *
                             std::pow(static_cast<double>(count) / 16'384, -power) +
                         floor;
      return SurfelTrial{.count = count,
                         .adapts = adapts,
                         .points = count,
                         .found = {.error = {.irradiance_rms = off, .irradiance_mean = 1},
                                   .low = 0.8 * off,
                                   .high = 1.2 * off}};
    };
  };
  for (const double first : {0.001, 0.02, 0.1, 0.2}) {
    for (const double power : {0.25, 0.6}) {
      for (const double gain : {0.5, 0.98, 1.3}) {
        const auto run = model(first, power, 0, gain);
        const SurfelChoice choice = search_surfels(0.03, run);
        INFO(first << ' ' << power << ' ' << gain << ": " << choice.taken.count << " in "
                   << choice.trials.size());
        REQUIRE(choice.met);
        CHECK(choice.taken.found.high <= 0.03);
        CHECK(choice.taken.adapts == (gain < 0.95));
        CHECK(choice.trials.size() <= 16);
        // A fifth fewer would not do, but for the scatter
        const bool fewest = choice.taken.count == 256;
        if (!fewest) {
          const double fewer =
              static_cast<double>(choice.taken.count) / 1.2 * std::pow(0.8, 1 / power);
          CHECK(run(static_cast<std::uint64_t>(fewer), choice.taken.adapts).found.high > 0.03);
        }
      }
    }
  }
  // A place whose light is wrong until surfels are smaller than what is around it, as above a lamp:
  // the error hardly falls, and is gone then
  const auto step = [&](std::uint64_t count, bool adapts) {
    SurfelTrial trial =
        model(0.04, count < 300'000 ? 0.03 : 1, 0, adapts ? 1.01 : 1)(count, adapts);
    return trial;
  };
  const SurfelChoice stepped = search_surfels(0.03, step);
  CHECK(stepped.met);
  CHECK(stepped.taken.count > 300'000);
  CHECK(stepped.taken.count < 600'000);
  // A floor above what is asked
  const SurfelChoice floored = search_surfels(0.03, model(0.1, 0.6, 0.05, 0.5));
  CHECK_FALSE(floored.met);
  double least = 1;
  std::uint64_t most = 0;
  for (const SurfelTrial& trial : floored.trials) {
    if (trial.adapts) least = std::min(least, trial.found.high);
    most = std::max(most, trial.count);
  }
  CHECK(floored.taken.found.high <= 1.05 * least);
  CHECK(most < 10'000'000);
}

TEST_CASE("surfel choice: light that the build leaves out is no error", "[integration][error]") {
  const TemporaryDirectory scratch;
  const auto mesh = scratch.path() / "ball.obj", target = scratch.path() / "o.ptcx";
  write_ball(mesh, 32, 0.1);
  BuildRequest request = request_for(mesh);
  request.sampling.count = 20'000;
  request.sampling.lights.sky_rays = 0;
  Progress silent;
  build_container(request, target, silent);
  const ThreadPool executor(2);
  const BoundedError told =
      SurfaceJudge(request, target, executor).measure(ContainerReader(target));
  CHECK(std::abs(told.error.irradiance_bias) < 0.02);
}

TEST_CASE("surfel choice: what has no mesh to compare with is refused", "[integration][error]") {
  const TemporaryDirectory scratch;
  const auto mesh = scratch.path() / "ball.obj", cloud = scratch.path() / "cloud.ply";
  write_ball(mesh, 48, 0.1);
  write_ply(cloud, random_surfels(50, 1), false);
  const auto field_of = [&](const BuildRequest& request, double asked) -> std::string {
    try {
      static_cast<void>(choose(request, asked, scratch.path()));
    } catch (const RequestError& error) {
      return error.field();
    }
    return "";
  };
  CHECK(field_of(request_for(mesh), 0) == "error");
  CHECK(field_of(request_for(mesh), 1.5) == "error");
  CHECK(field_of(request_for(cloud), 0.05) == "error");
  BuildRequest both = request_for(mesh);
  both.inputs.push_back(cloud);
  CHECK(field_of(both, 0.05) == "error");
  BuildRequest city;
  city.city_points = 1'000;
  CHECK(field_of(city, 0.05) == "error");
  BuildRequest away = request_for(mesh);
  away.sampling.camera = Camera{.position = {0, 5, 0}, .look_at = {0, 9, 0}};
  CHECK(field_of(away, 0.05) == "error");
  BuildRequest streams = request_for(scratch.path() / "fine.obj");
  write_ball(streams.inputs[0], 400, 0.1);
  streams.run.memory_bytes = std::uint64_t{150} << 20;
  CHECK(field_of(streams, 0.05) == "error");
}
