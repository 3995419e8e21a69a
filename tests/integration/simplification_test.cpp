// Containers in fewer bytes: the error that is told, the choice by it, and what is written.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/point_error.h"
#include "engine/pipeline/quality/simplification_choice.h"
#include "engine/pipeline/scene_record.h"
#include "engine/shade/lift.h"
#include "engine/trace/ray_shader.h"
#include "engine/verify/verify.h"
#include "tests/support/notes.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// A trial whose errors follow formulas.
struct Model {
  double per_rounding = 0.1, per_merging = 0.5, light_per_merging = 0.4;

  SimplificationTrial operator()(double merging, double rounding) const {
    SimplificationTrial trial{.merging = merging, .rounding = rounding};
    trial.found.high = std::hypot(per_rounding * rounding, per_merging * merging);
    trial.light_error = light_per_merging * merging;
    return trial;
  }
};

/// Returns a mesh of a box on a ground, lit by a sun.
BuildRequest box_request() {
  auto mesh = std::make_shared<Mesh>();
  const auto quad = [&](const glm::vec3& a, const glm::vec3& u, const glm::vec3& v) {
    const auto first = static_cast<std::uint32_t>(mesh->positions.size());
    for (const glm::vec3& p : {a, a + u, a + u + v, a + v}) mesh->positions.push_back(p);
    mesh->triangles.push_back({first, first + 1, first + 2});
    mesh->triangles.push_back({first, first + 2, first + 3});
    mesh->material_of.insert(mesh->material_of.end(), 2, 0);
  };
  mesh->materials.push_back({});
  quad({-4, 0, -4}, {0, 0, 8}, {8, 0, 0});
  quad({-1, 2, -1}, {0, 0, 2}, {2, 0, 0});
  quad({-1, 0, 1}, {2, 0, 0}, {0, 2, 0});
  quad({1, 0, 1}, {0, 0, -2}, {0, 2, 0});
  quad({1, 0, -1}, {-2, 0, 0}, {0, 2, 0});
  quad({-1, 0, -1}, {0, 0, 2}, {0, 2, 0});
  BuildRequest request;
  request.mesh = mesh;
  request.sampling.count = 60'000;
  return request;
}

}  // namespace

TEST_CASE("simplification: the coarsest is taken that meets what is asked",
          "[integration][error]") {
  for (const double asked : {0.001, 0.03, 0.4}) {
    const Model model;
    const SimplificationChoice choice = search_simplification(asked, true, model);
    CHECK(choice.met);
    CHECK(choice.taken.error() <= asked);
    CHECK(choice.taken.rounding == asked);
    // A fifth more would be too much
    CHECK(model(1.2 * choice.taken.merging, choice.taken.rounding).error() > asked);
    CHECK(choice.trials.size() <= 10);
  }
  // Light that leaves surfels counts as well as what arrives
  const Model light{.light_per_merging = 2};
  const SimplificationChoice lit = search_simplification(0.03, true, light);
  CHECK(lit.taken.light_error <= 0.03);
  CHECK(lit.taken.light_error > 0.03 / 1.2);
  // Where rounding alone takes much of it, it is made finer first
  const Model rough{.per_rounding = 2};
  const SimplificationChoice fine = search_simplification(0.03, true, rough);
  CHECK(fine.taken.rounding == Approx(0.03 / 4));
  CHECK(fine.taken.merging > 0);
  CHECK(fine.taken.error() <= 0.03);
  // What must not be merged is not, and where merging never does, none is
  CHECK(search_simplification(0.03, false, Model{}).taken.merging == 0);
  CHECK(search_simplification(0.03, true, Model{.per_merging = 100}).taken.merging == 0);
  const SimplificationChoice none = search_simplification(0.03, true, Model{.per_rounding = 100});
  CHECK_FALSE(none.met);
  CHECK(none.taken.merging == 0);
}

TEST_CASE("simplification: the error of a container is that which other rays find",
          "[integration][error]") {
  const TemporaryDirectory scratch;
  const auto exact_path = scratch.path() / "exact.ptcx", other_path = scratch.path() / "other.ptcx";
  const std::vector<Surfel> surfels = small_scene(0.02);
  write_scene(exact_path, surfels);
  // Without the balls, which are what lies above the floor and off the wall
  std::vector<Surfel> fewer;
  for (const Surfel& s : surfels)
    if (std::abs(s.normal.x) > 0.999F || std::abs(s.normal.z) > 0.999F) fewer.push_back(s);
  REQUIRE(fewer.size() < surfels.size());
  write_scene(other_path, fewer);

  const ThreadPool executor(2);
  const ContainerReader exact(exact_path), other(other_path);
  PointJudge judge(exact, {}, scratch.path() / "o.ptcx", executor);
  CHECK(judge.measure(exact).high == 0);
  const BoundedError told = judge.measure(other);

  // Trace other rays at other points
  std::vector<Receiver> receivers;
  for (std::size_t i = 0; i < surfels.size(); i += 3)
    receivers.push_back(lifted(surfels[i], 0.15F, exact.header().frame));
  std::vector<Shading> a(receivers.size()), b(receivers.size());
  Progress silent;
  RayShader(exact, {}, executor).trace(receivers, 512, 7, a, silent);
  RayShader(other, {}, executor).trace(receivers, 512, 7, b, silent);
  double square = 0, bias = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double off = double{b[i].occlusion} - double{a[i].occlusion};
    square += off * off / static_cast<double>(a.size());
    bias += off / static_cast<double>(a.size());
  }
  CHECK(std::sqrt(square) > 0.02);
  CHECK(told.error.occlusion_rms == Approx(std::sqrt(square)).epsilon(0.1));
  CHECK(told.error.occlusion_bias == Approx(bias).epsilon(0.1));
  CHECK(told.low <= told.error.relative());
  CHECK(told.error.relative() <= told.high);
}

TEST_CASE("simplification: a scene with flat walls takes far fewer bytes, and is sound",
          "[integration][error]") {
  const TemporaryDirectory scratch;
  const auto compact = scratch.path() / "compact.ptcx", small = scratch.path() / "small.ptcx",
             again = scratch.path() / "again.ptcx";
  BuildRequest request = box_request();
  Progress silent;
  const BuildReport usual = build_container(request, compact, silent);
  const SimplifiedBuild made = build_within(request, 0.03, small, silent);
  CHECK(made.choice->met);
  CHECK(made.choice->taken.error() <= 0.03);
  CHECK(made.choice->taken.merged.points == usual.superblock.points);
  CHECK(made.report.superblock.points == made.choice->taken.points);
  CHECK(made.report.superblock.points < usual.superblock.points / 4);
  CHECK(made.report.superblock.file_bytes < usual.superblock.file_bytes / 3);
  CHECK(made.report.superblock.area == Approx(usual.superblock.area).epsilon(0.01));
  CHECK(verify_container(small, {}, silent).sound());

  // It says what it is
  const ContainerReader scene(small);
  CHECK(scene.meta().text.at(kSimplifiedKey) == made.choice->record());
  CHECK(scene.meta().text.at(kRoundingKey) ==
        rounding_text(made.choice->taken.simplification().rounding));
  CHECK(surfel_spacing(scene) == surfel_spacing(ContainerReader(compact)));

  // Neither threads nor the cap matter
  request.run.threads = 3;
  request.run.memory_bytes = 128 << 20;
  static_cast<void>(build_within(request, 0.03, again, silent));
  CHECK(bytes_of(again) == bytes_of(small));

  // A second tolerance hides nothing of the first
  const RecodeOptions options{.profile = Profile::compact};
  StageSeconds seconds;
  const SimplificationChoice second =
      choose_simplification(scene, 0.01, options, again, seconds, silent);
  recode_container(scene, again, simplified(options, second), silent);
  const ContainerReader twice(again);
  const auto& text = twice.meta().text;
  CHECK(text.at(kSimplifiedKey).find("\"before\":{\"tolerance\":0.03") != std::string::npos);
  CHECK(text.at(kRoundingKey).ends_with("; before: " + scene.meta().text.at(kRoundingKey)));

  // The finer, the more is kept
  request.run = {};
  const SimplifiedBuild finer = build_within(request, 0.005, again, silent);
  CHECK(finer.report.superblock.points > made.report.superblock.points);
  CHECK(finer.choice->taken.error() <= 0.005);
}

TEST_CASE("simplification: points with channels are rounded and none is lost",
          "[integration][error]") {
  const TemporaryDirectory scratch;
  const auto shaded = scratch.path() / "shaded.ptcx", small = scratch.path() / "small.ptcx";
  BuildRequest request = box_request();
  request.sampling.count = 5'000;
  request.original_order = true;
  request.profile = Profile::exact;
  Progress silent;
  build_container(request, shaded, silent);
  const ContainerReader from(shaded);
  REQUIRE(from.meta().channels.size() == 1);
  Notes told;
  StageSeconds seconds;
  const RecodeOptions options{.profile = Profile::compact};
  const SimplificationChoice choice =
      choose_simplification(from, 0.03, options, small, seconds, told);
  CHECK(choice.taken.merging == 0);
  REQUIRE(told.texts.size() == 1);
  CHECK(told.texts[0].find("none are merged") != std::string::npos);
  recode_container(from, small, simplified(options, choice), silent);
  const ContainerReader to(small);
  CHECK(to.superblock().points == from.superblock().points);
  CHECK(to.superblock().file_bytes < from.superblock().file_bytes);
  CHECK(to.meta().channels == from.meta().channels);
  CHECK(verify_container(small, {}, silent).sound());
}

TEST_CASE("simplification: what contradicts itself is refused", "[integration][error]") {
  const TemporaryDirectory scratch;
  const auto target = scratch.path() / "o.ptcx";
  Progress silent;
  BuildRequest request = box_request();
  request.profile = Profile::exact;
  CHECK_THROWS_AS(build_within(request, 0.03, target, silent), RequestError);
  request.profile = Profile::compact;
  CHECK_THROWS_AS(build_within(request, 0, target, silent), RequestError);
  CHECK_THROWS_AS(build_within(request, 1.5, target, silent), RequestError);
  request.resume = true;
  CHECK_THROWS_AS(build_within(request, 0.03, target, silent), RequestError);
  CHECK_FALSE(std::filesystem::exists(target));
}
