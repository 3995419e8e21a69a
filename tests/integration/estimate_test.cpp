// Estimated errors of receivers, compared with their errors against rays.
#include "engine/pipeline/quality/estimate.h"

#include <algorithm>
#include <string>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/ptc.h"
#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

ShadeRequest request_of(const Scene& scene, bool estimate) {
  ShadeRequest request{{.scene = scene.dir / "scene.ptcx", .error = 0.05, .estimate = estimate}};
  request.run.threads = 1;
  return request;
}

LightingReport shade(const Scene& scene, const ShadeRequest& request, const char* name) {
  Progress silent;
  return shade_container(request, scene.dir / name, silent);
}

std::vector<std::string> channels_of(const std::filesystem::path& path) {
  std::vector<std::string> names;
  const ContainerReader container(path);
  for (const Channel& c : container.meta().channels) names.push_back(c.name);
  return names;
}

bool names(const std::filesystem::path& path, const std::string& text) {
  const std::vector<char> bytes = bytes_of(path);
  return std::search(bytes.begin(), bytes.end(), text.begin(), text.end()) != bytes.end();
}

void check_worth(const EstimateWorth& worth) {
  CAPTURE(worth.rank, worth.top_third, worth.bottom_third, worth.rms, worth.within_twice);
  CHECK(worth.rms > 1 / 1.5);
  CHECK(worth.rms < 1.5);
  CHECK(worth.top_third > 1.2 * worth.bottom_third);
  CHECK(worth.rank > 0.2);
  CHECK(worth.within_twice > 0.7);
}

}  // namespace

TEST_CASE("estimate: a fitted line has the mean of the errors and no negative coefficient",
          "[integration][estimate]") {
  const ErrorLine exact = fit_errors(std::vector<ErrorSample>{{0, 1}, {1, 3}, {2, 5}, {4, 9}});
  CHECK(exact.constant == Approx(1));
  CHECK(exact.slope == Approx(2));
  const ErrorLine falling = fit_errors(std::vector<ErrorSample>{{0, 4}, {1, 2}, {2, 0}});
  CHECK(falling.constant == Approx(2));
  CHECK(falling.slope == 0);
  const ErrorLine steep = fit_errors(std::vector<ErrorSample>{{1, 0}, {2, 1}, {3, 5}});
  CHECK(steep.constant == 0);
  CHECK(steep.slope == Approx(1));
  const ErrorLine alike = fit_errors(std::vector<ErrorSample>{{0, 1}, {0, 2}});
  CHECK(alike.constant == Approx(1.5));
  CHECK(alike.slope == 0);
  for (const auto& none : {std::vector<ErrorSample>{}, {{1, 0}, {2, 0}}, {{1, 1}, {2, -2}}}) {
    CHECK(fit_errors(none).constant == 0);
    CHECK(fit_errors(none).slope == 0);
  }
}

TEST_CASE("estimate: errors at other receivers are as large as estimated and ordered as estimated",
          "[integration][estimate]") {
  const Scene scene(small_scene(0.02));
  for (const bool tuned : {true, false}) {
    ShadeRequest request = request_of(scene, true);
    if (!tuned) {
      request.error.reset();
      request.gather = {.solid_angle = 0.05F, .parallax = 0.25F, .resolution = 16};
    }
    request.check = {.receivers = 1500, .rays = 1024};
    const LightingReport report = shade(scene, request, "a.ply");
    REQUIRE(report.check->estimate);
    CHECK(report.estimate->pilots >= 400);
    CAPTURE(tuned);
    check_worth(report.check->estimate->occlusion);
    check_worth(report.check->estimate->irradiance);
  }
}

TEST_CASE("estimate: its channels exist when requested and change no other channel",
          "[integration][estimate]") {
  const Scene scene(small_scene(0.08));
  const LightingReport without = shade(scene, request_of(scene, false), "without.ptcx");
  const LightingReport with = shade(scene, request_of(scene, true), "with.ptcx");
  CHECK_FALSE(without.estimate);
  CHECK(with.estimate->cpu_seconds > 0);
  std::vector<std::string> expected = channels_of(scene.dir / "without.ptcx");
  CHECK(std::ranges::count(expected, "occlusion_error") == 0);
  const auto indirect = std::ranges::find(expected, "indirect");
  REQUIRE(indirect != expected.end());
  const std::vector<std::string> added{"occlusion_error", "irradiance_error"};
  expected.insert(indirect + 1, added.begin(), added.end());
  CHECK(channels_of(scene.dir / "with.ptcx") == expected);

  for (const bool estimate : {false, true}) {
    shade(scene, request_of(scene, estimate), "a.ply");
    CHECK(names(scene.dir / "a.ply",
                "property float occlusion_error\nproperty float irradiance_error\n") == estimate);
    RenderRequest picture{{.scene = scene.dir / "scene.ptcx", .error = 0.1, .estimate = estimate}};
    picture.samples = 1;
    picture.size = {{64, 48}};
    Progress silent;
    const std::vector<PictureTarget> targets{{scene.dir / "a.exr"}};
    const LightingReport report = render_picture(picture, targets, silent);
    CHECK(report.estimate.has_value() == estimate);
    CHECK(names(scene.dir / "a.exr", "occlusion_error.V") == estimate);
    CHECK(names(scene.dir / "a.exr", "irradiance_error.V") == estimate);
  }

  // Shading again without estimates removes the earlier ones.
  ShadeRequest again = request_of(scene, false);
  again.scene = scene.dir / "with.ptcx";
  shade(scene, again, "again.ptcx");
  CHECK(channels_of(scene.dir / "again.ptcx") == channels_of(scene.dir / "without.ptcx"));
}

TEST_CASE("estimate: neither threads nor the cap change any byte", "[integration][estimate]") {
  const Scene scene(small_scene(0.03));
  ShadeRequest request = request_of(scene, true);
  RenderRequest picture{{.scene = request.scene, .error = 0.05, .estimate = true}};
  picture.samples = 4;
  picture.size = {{64, 48}};
  const auto run = [&](unsigned threads, std::uint64_t mebibytes, const std::string& name) {
    request.run = picture.run = {.memory_bytes = mebibytes << 20, .threads = threads};
    shade(scene, request, (name + ".ptcx").c_str());
    Progress silent;
    const std::vector<PictureTarget> targets{{scene.dir / (name + ".exr")}};
    render_picture(picture, targets, silent);
  };
  run(1, 1024, "one");
  run(2, 160, "two");
  CHECK(bytes_of(scene.dir / "one.ptcx") == bytes_of(scene.dir / "two.ptcx"));
  CHECK(bytes_of(scene.dir / "one.exr") == bytes_of(scene.dir / "two.exr"));
}

TEST_CASE("estimate: a run without rays is refused, a run without receivers is not",
          "[integration][estimate]") {
  const Scene scene(small_scene(0.1));
  ShadeRequest request = request_of(scene, true);
  request.error.reset();
  CHECK_THROWS_AS(shade(scene, request, "a.ply"), RequestError);
  request.check = {.receivers = 10, .rays = 64};
  CHECK_NOTHROW(shade(scene, request, "a.ply"));
  RenderRequest picture{{.scene = request.scene, .estimate = true}};
  picture.size = {{16, 12}};
  Progress silent;
  CHECK_THROWS_WITH(
      render_picture(picture, std::vector<PictureTarget>{{scene.dir / "a.exr"}}, silent),
      Catch::Contains("`error` or `check`"));
  picture.error = 0.1;
  CHECK_THROWS_WITH(
      render_picture(picture, std::vector<PictureTarget>{{scene.dir / "a.png"}}, silent),
      Catch::Contains(".exr"));
  const Scene empty({});
  CHECK(shade(empty, request_of(empty, true), "a.ptcx").estimate->pilots == 0);
  request = request_of(scene, true);
  request.count = 1;
  CHECK(shade(scene, request, "a.ply").estimate->pilots == 1);
}
