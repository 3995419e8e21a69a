// The hunt: what it draws, how it judges, and the scenes that it found.
#include "tools/bench/hunt/hunt.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numbers>
#include <set>
#include <string>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "tests/support/temporary_directory.h"
#include "tools/bench/hunt/kept_scenes.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

/// The area that the surfels of one shape count for.
double area_of(const Shape& shape) {
  double area = 0;
  for (const Surfel& surfel : surfels_of({.shapes = {shape}}))
    area += 2 * static_cast<double>(surfel.radius * surfel.radius);
  return area;
}

}  // namespace

TEST_CASE("hunt: a hundred scenes keep to their bounds", "[stability][hunt]") {
  const test::TemporaryDirectory dir;
  const ThreadPool executor;
  const Lab lab{dir.path(), executor};
  std::array<std::vector<double>, 3> errors;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const Judgement found = judge(draw_scene(seed), lab, 1024);
    CAPTURE(seed);
    CHECK(found.sound);
    for (std::size_t kind = 0; kind < 3; ++kind) errors[kind].push_back(found.errors[kind]);
  }
  constexpr double kMedian[] = {0.006, 0.006, 0.004}, kNinety[] = {0.016, 0.016, 0.03},
                   kWorst[] = {0.04, 0.06, 0.15};
  for (std::size_t kind = 0; kind < 3; ++kind) {
    std::ranges::sort(errors[kind]);
    INFO(name_of(kHuntErrors[kind]));
    CHECK(quantile(errors[kind], 0.5) <= kMedian[kind]);
    CHECK(quantile(errors[kind], 0.9) <= kNinety[kind]);
    CHECK(quantile(errors[kind], 1) <= kWorst[kind]);
  }
}

TEST_CASE("hunt: scenes that were found keep to their bounds", "[stability][hunt]") {
  const test::TemporaryDirectory dir;
  const ThreadPool executor;
  const Lab lab{dir.path(), executor};
  std::set<std::string> names;
  for (const KeptScene& kept : kept_scenes()) {
    const HuntScene scene = scene_of(kept.text);
    INFO(kept.name << ": " << kept.why);
    CHECK(text_of(scene) == kept.text);
    const Judgement found = judge(scene, lab, 4096);
    CHECK(found.sound);
    CHECK(found[kept.kind] <= kept.bound);
    names.insert(kept.name);
  }
  CHECK(names.size() == kept_scenes().size());
}

TEST_CASE("hunt: results of thousands of receivers do not depend on threads", "[stability][hunt]") {
  const test::TemporaryDirectory dir;
  const ThreadPool executor;
  for (const std::uint64_t seed : {3U, 8U})
    CHECK(same_on_any_threads(draw_scene(seed), {dir.path(), executor}));
}

TEST_CASE("hunt: what is drawn has all kinds, is written, and read as it was",
          "[stability][hunt]") {
  std::string kinds;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    CAPTURE(seed);
    const HuntScene scene = draw_scene(seed);
    CHECK(scene_of(text_of(scene)) == scene);
    CHECK(draw_scene(seed) == scene);
    const std::size_t surfels = surfels_of(scene).size();
    CHECK((surfels >= 100 && surfels <= 4500));
    CHECK(scene.receivers.size() == 48);
    kinds += kinds_of(scene) + " ";
  }
  for (const char* kind : {"wall", "sheet", "pair", "wedge", "slit", "box", "room", "ball",
                           "hollow", "disc", "leaves", "rod"})
    CHECK(kinds.find(kind) != std::string::npos);
}

TEST_CASE("hunt: lines that are none of a scene are refused", "[stability][hunt]") {
  for (const char* line : {"cube at 0 0 0", "wall at 0 0", "wall turn 0 0 0 high 3", "sky blue",
                           "scale", "receiver 0 0 0", "receiver 0 0 0 normal 0 1", "wall size x"}) {
    CAPTURE(line);
    CHECK_THROWS_AS(scene_of(line), DataError);
  }
}

TEST_CASE("hunt: surfels of a shape have its area", "[stability][hunt]") {
  using Kind = ShapeKind;
  constexpr double kTurn = std::numbers::pi;
  const auto area = [](Kind kind, double gap) {
    return area_of(
        {.kind = kind, .turn = {30, 40, 50}, .size = {2, 3, 1}, .gap = gap, .spacing = 0.04});
  };
  CHECK(area(Kind::wall, 0) == Approx(6).epsilon(0.01));
  CHECK(area(Kind::sheet, 0) == Approx(6 + 0.98 * 0.98 * 6).epsilon(0.01));
  CHECK(area(Kind::pair, 0.1) == Approx(12).epsilon(0.01));
  CHECK(area(Kind::wedge, 40) == Approx(12).epsilon(0.01));
  CHECK(area(Kind::slit, 0.5) == Approx(5).epsilon(0.01));
  CHECK(area(Kind::box, 0) == Approx(22).epsilon(0.01));
  CHECK(area(Kind::room, 0.5) == Approx(21).epsilon(0.01));
  CHECK(area(Kind::ball, 0) == Approx(16 * kTurn).epsilon(0.01));
  CHECK(area(Kind::hollow, 0) == Approx(16 * kTurn).epsilon(0.01));
  CHECK(area(Kind::disc, 0) == Approx(4 * kTurn).epsilon(0.01));
  CHECK(area(Kind::leaves, 0) == Approx(9).epsilon(0.01));
  CHECK(area(Kind::rod, 0.3) == Approx(2 * kTurn * 0.3 * 2).epsilon(0.01));
}

TEST_CASE("hunt: a scene shrinks to what its fault needs", "[stability][hunt]") {
  HuntScene scene = draw_scene(11);
  scene.scale = 3;
  scene.sky = HuntSky::rising;
  scene.shapes.push_back({.kind = ShapeKind::rod, .at = {1, 2, 3}, .turn = {7, 8, 9}, .gap = 0.1});
  scene.receivers.push_back({{7, 7, 7}, {0, 0, 1}});
  // The fault: a rod that is turned about x, and a receiver far up
  const auto fault = [](const HuntScene& s) {
    const bool rod = std::ranges::any_of(s.shapes, [](const Shape& shape) {
      return shape.kind == ShapeKind::rod && shape.turn.x > 0;
    });
    const bool up =
        std::ranges::any_of(s.receivers, [](const HuntReceiver& r) { return r.at.z > 5; });
    return rod && up ? 1.0 : 0.0;
  };
  const HuntScene small = shrink(scene, fault, 1000);
  CHECK(fault(small) == 1);
  CHECK(kinds_of(small) == "rod");
  CHECK(small.receivers.size() == 1);
  CHECK(small.scale == 1);
  CHECK(small.sky == HuntSky::none);
  CHECK(small.shapes[0].at == glm::dvec3(0));
  // Without measurements it stays
  CHECK(shrink(scene, fault, 0) == scene);
}

TEST_CASE("hunt: results that cannot be are told", "[stability][hunt]") {
  const Shading right{.occlusion = 0.5F, .bent_normal = {0, 0, 1}, .irradiance = glm::vec3(1)};
  CHECK(is_sound(right));
  const float odd = std::numeric_limits<float>::quiet_NaN();
  Shading wrong = right;
  for (const float occlusion : {odd, -0.001F, 1.001F}) {
    wrong.occlusion = occlusion;
    CHECK_FALSE(is_sound(wrong));
  }
  wrong = right;
  wrong.bent_normal = glm::vec3(0);
  CHECK_FALSE(is_sound(wrong));
  for (const float light : {odd, -4.0F, 4.0F, std::numeric_limits<float>::infinity()}) {
    wrong = right;
    wrong.sky.g = light;
    CHECK_FALSE(is_sound(wrong));
  }
}

TEST_CASE("hunt: a share of sorted errors does not exceed a quantile", "[stability][hunt]") {
  const std::vector<double> errors{1, 2, 3, 4};
  CHECK(quantile(errors, 0.5) == 2);
  CHECK(quantile(errors, 0.51) == 3);
  CHECK(quantile(errors, 0) == 1);
  CHECK(quantile(errors, 1) == 4);
}
