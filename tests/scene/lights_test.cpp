// Suns, point lights, spot lights and the constant sky, compared with formulas.
#include "engine/scene/light/lights.h"

#include <cmath>
#include <limits>
#include <string>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/sampling/directions.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

const glm::vec3 kUp(0, 1, 0);

LightRig one_sun(const glm::vec3& to_sun, float radius) {
  LightRig rig;
  rig.suns.push_back({glm::normalize(to_sun), {3, 2, 1}, radius});
  return rig;
}

}  // namespace

TEST_CASE("sun: azimuth and elevation follow the axis that points up", "[scene][lights]") {
  const auto check = [](const glm::vec3& up, const glm::vec3& at_0, const glm::vec3& at_90) {
    CHECK(glm::distance(sun_direction(0, 0, up), at_0) < 1e-6F);
    CHECK(glm::distance(sun_direction(90, 0, up), at_90) < 1e-6F);
    CHECK(glm::distance(sun_direction(17, 90, up), up) < 1e-6F);
    CHECK(glm::dot(sun_direction(200, 30, up), up) == Approx(0.5));
    const LightRig rig = default_rig(up);
    CHECK(glm::dot(rig.suns.at(0).to_sun, up) > 0.7F);
    CHECK(rig.sky.up == up);
  };
  check({0, 1, 0}, {0, 0, 1}, {1, 0, 0});
  check({0, 0, 1}, {0, 1, 0}, {1, 0, 0});
  check({1, 0, 0}, {0, 1, 0}, {0, 0, 1});
}

TEST_CASE("sun: a plane gets the sun's irradiance times the cosine", "[scene][lights]") {
  const Mesh mesh = ground(10);
  const RayScene scene(mesh);
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const glm::vec3 to_sun = random.direction();
    const DirectLight light(scene, one_sun(to_sun, i % 2 == 0 ? 0.0f : 0.00465f));
    const auto result = light.irradiance({0.1, 0, 0.2}, kUp, {}, static_cast<std::uint64_t>(i));
    if (std::abs(to_sun.y) < 0.01f) continue;  // the horizon cuts the disc
    const float cosine = std::max(0.0f, to_sun.y);
    CHECK(result.local.x == Approx(3 * cosine).margin(0.01));
    CHECK(result.local.y == Approx(2 * cosine).margin(0.01));
    CHECK(result.local.z == Approx(1 * cosine).margin(0.01));
    CHECK(result.sky == glm::vec3(0));
  }
}

TEST_CASE("sun: a wide disc still gives its full irradiance to a surface that faces it",
          "[scene][lights]") {
  const Mesh mesh = ground(10);
  const RayScene scene(mesh);
  for (const float radius : {0.1f, 0.5f, 1.5f, 1.5707963f}) {
    const DirectLight light(scene, one_sun(kUp, radius));
    CHECK(light.irradiance({0, 0, 0}, kUp, {64, 0, 0}, 1).local.x == Approx(3).epsilon(1e-3));
  }
}

TEST_CASE("sun: a disc half below the horizon gives the light of its upper half",
          "[scene][lights]") {
  const Mesh mesh = ground(10);
  const RayScene scene(mesh);
  const float radius = 0.2f;
  const DirectLight light(scene, one_sun({1, 0, 0}, radius));
  // The upper half of a uniform disc of radiance E / (pi sin^2 r): E * 2 (r - sin r cos r) / (pi
  // sin^2 r) / 2, by integrating the height over the half cap.
  const double sine = std::sin(static_cast<double>(radius));
  const double expected =
      3 * (static_cast<double>(radius) - sine * std::cos(static_cast<double>(radius))) /
      (3.14159265358979 * sine * sine);
  CHECK(static_cast<double>(light.irradiance({0, 0, 0}, kUp, {4096, 0, 0}, 1).local.x) ==
        Approx(expected).epsilon(0.01));
}

TEST_CASE("sun: a wall casts a sharp shadow, and half a disc behind it gives half the light",
          "[scene][lights]") {
  Mesh mesh = ground(10);
  add_quad(mesh, {1, 0, 5}, {0, 0, -10}, {0, 1, 0});  // of height 1 at x = 1
  const RayScene scene(mesh);
  const DirectLight sharp(scene, one_sun({1, 1, 0}, 0));
  CHECK(sharp.irradiance({0.01, 0, 0}, kUp, {}, 1).local == glm::vec3(0));
  CHECK(sharp.irradiance({-0.01, 0, 0}, kUp, {}, 1).local.x > 2);
  CHECK(sharp.irradiance({1.01, 0, 0}, kUp, {}, 1).local.x > 2);
  const DirectLight wide(scene, one_sun({1, 1, 0}, 0.1f));
  CHECK(wide.irradiance({0, 0, 0}, kUp, {1024, 0, 0}, 1).local.x ==
        Approx(1.5 * std::sqrt(0.5)).epsilon(0.05));
}

TEST_CASE("point light: the irradiance falls with the square of the distance", "[scene][lights]") {
  const Mesh mesh = ground(100);
  const RayScene scene(mesh);
  for (const double height : {0.01, 0.1, 1.0, 10.0, 1000.0}) {
    LightRig rig;
    rig.points.push_back({{0, height, 0}, {2, 4, 8}});
    const DirectLight light(scene, rig);
    for (const double aside : {0.0, 0.5, 3.0}) {
      const double square = height * height + aside * aside;
      const double expected = height / std::sqrt(square) / square;
      const auto result = light.irradiance({aside, 0, 0}, kUp, {}, 1);
      CHECK(static_cast<double>(result.local.x) == Approx(2 * expected).epsilon(0.02));
      CHECK(static_cast<double>(result.local.z) == Approx(8 * expected).epsilon(0.02));
    }
    CHECK(light.irradiance({0, 0, 0}, -kUp, {}, 1).local == glm::vec3(0));
  }
}

TEST_CASE("point light: an object in between hides the light, one behind it does not",
          "[scene][lights]") {
  Mesh mesh = ground(10);
  add_quad(mesh, {-1, 1, 1}, {2, 0, 0}, {0, 0, -2});
  const RayScene scene(mesh);
  LightRig rig;
  rig.points.push_back({{0, 2, 0}, glm::vec3(1)});
  rig.points.push_back({{0, 0.5, 0}, glm::vec3(1)});
  const DirectLight light(scene, rig);
  CHECK(light.irradiance({0, 0, 0}, kUp, {}, 1).local.x == Approx(4).epsilon(1e-4));
}

TEST_CASE("spot light: a plane across the axis gets the intensity over the squared distance",
          "[scene][lights]") {
  const Mesh mesh = ground(100);
  const RayScene scene(mesh);
  for (const double height : {0.1, 1.0, 10.0, 1000.0}) {
    for (const float inner : {0.0f, 0.2f, 0.5f}) {
      LightRig rig;
      rig.spots.push_back({.position = {0, height, 0},
                           .intensity = {2, 4, 8},
                           .inner_angle = inner,
                           .outer_angle = 0.5f});
      const auto result = DirectLight(scene, rig).irradiance({0, 0, 0}, kUp, {}, 1);
      CHECK(static_cast<double>(result.local.x) == Approx(2 / (height * height)).epsilon(1e-6));
      CHECK(static_cast<double>(result.local.z) == Approx(8 / (height * height)).epsilon(1e-6));
    }
  }
}

TEST_CASE("spot light: between the cones the intensity falls as the squared share of the cosine",
          "[scene][lights]") {
  const Mesh mesh = ground(100);
  const RayScene scene(mesh);
  const double inner = 0.3;
  const double outer = 0.8;
  LightRig rig;
  rig.spots.push_back({.position = {0, 2, 0},
                       .direction = {0, -3, 0},  // of any length
                       .intensity = glm::vec3(5),
                       .inner_angle = static_cast<float>(inner),
                       .outer_angle = static_cast<float>(outer)});
  const DirectLight light(scene, rig);
  // At a share of the way from the outer to the inner cosine the irradiance is that of a point
  // light, I cos^3 / h^2, times the square of the share.
  for (const double share : {0.01, 0.25, 0.5, 0.75, 0.99}) {
    const double cosine = std::cos(outer) + share * (std::cos(inner) - std::cos(outer));
    const double aside = 2 * std::tan(std::acos(cosine));
    const double expected = 5 * cosine * cosine * cosine / 4 * share * share;
    CHECK(static_cast<double>(light.irradiance({aside, 0, 0}, kUp, {}, 1).local.x) ==
          Approx(expected).epsilon(1e-4));
  }
  // Just within the inner cone it is all, just outside the outer cone and behind it is nothing.
  const auto at = [&](double angle) {
    return light.irradiance({2 * std::tan(angle), 0, 0}, kUp, {}, 1).local.x;
  };
  CHECK(static_cast<double>(at(0.299)) == Approx(5 * std::pow(std::cos(0.299), 3) / 4));
  CHECK(at(0.801) == 0);
  CHECK(at(1.5) == 0);
  CHECK(light.irradiance({0, 3, 0}, -kUp, {}, 1).local == glm::vec3(0));
}

TEST_CASE("spot light: a cone without a blend has a hard edge, and none is too narrow",
          "[scene][lights]") {
  for (const float angle : {2e-4f, 0.01f, 0.5f, 1.5707963f}) {
    for (const glm::vec3 along : {glm::vec3(0, 0, 1), glm::vec3(1, -1, 1), glm::vec3(1, -2, 1)}) {
      const SpotLight spot{
          .direction = glm::normalize(along), .inner_angle = angle, .outer_angle = angle};
      const glm::dvec3 axis = glm::normalize(glm::dvec3(spot.direction));
      const glm::dvec3 aside = glm::normalize(glm::cross(axis, glm::dvec3(0, 1, 0.5)));
      const auto share = [&](double of_angle) {
        const double turned = of_angle * static_cast<double>(angle);
        return spot_share(spot, axis * std::cos(turned) + aside * std::sin(turned));
      };
      CAPTURE(angle, along.x, along.y);
      CHECK(share(0) == 1);
      CHECK(share(0.999) == 1);
      CHECK(share(1.001) == 0);
    }
  }
  CHECK(spot_share({}, {0, 0, 0}) == 0);
}

TEST_CASE("spot light: an object in between hides the light", "[scene][lights]") {
  Mesh mesh = ground(10);
  add_quad(mesh, {-1, 1, 1}, {1, 0, 0}, {0, 0, -2});  // over x from -1 to 0
  const RayScene scene(mesh);
  LightRig rig;
  rig.spots.push_back({.position = {0, 2, 0}});
  const DirectLight light(scene, rig);
  CHECK(light.irradiance({-0.1, 0, 0}, kUp, {}, 1).local == glm::vec3(0));
  CHECK(light.irradiance({0.1, 0, 0}, kUp, {}, 1).local.x > 0.1f);
}

TEST_CASE("sky: a constant sky gives an open plane pi times its radiance", "[scene][lights]") {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    Mesh mesh = ground(1);
    const glm::mat3 rotation = random.rotation();
    turn(mesh, rotation);
    if (i % 2 == 1) mesh.origin = {1e7, 1e7, -1e7};
    const RayScene scene(mesh);
    LightRig rig;
    rig.sky.radiance = {1, 2, 3};
    const DirectLight light(scene, rig);
    const glm::dvec3 at = mesh.origin + glm::dvec3(rotation * glm::vec3(0.3f, 0, 0.4f));
    const auto result = light.irradiance(at, rotation * kUp, {}, static_cast<std::uint64_t>(i));
    CHECK(result.sky.x == Approx(1 * kPi).epsilon(1e-5));
    CHECK(result.sky.y == Approx(2 * kPi).epsilon(1e-5));
    CHECK(result.sky.z == Approx(3 * kPi).epsilon(1e-5));
    CHECK(result.local == glm::vec3(0));
  }
}

TEST_CASE("sky: a wall next to the point hides half of the sky", "[scene][lights]") {
  Mesh mesh = ground(1000);
  add_quad(mesh, {0, 0, 1000}, {0, 1000, 0}, {0, 0, -2000});
  const RayScene scene(mesh);
  LightRig rig;
  rig.sky.radiance = glm::vec3(1);
  const DirectLight light(scene, rig);
  double mean = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    mean += static_cast<double>(light.irradiance({1, 0, 0}, kUp, {}, seed).sky.x) / 200;
  }
  CHECK(mean == Approx(1.5708).epsilon(0.01));
}

TEST_CASE("direct light: the seed fixes the result, and another seed changes it",
          "[scene][lights]") {
  Mesh mesh = ground(10);
  add_box(mesh, {0.5f, 0, -1}, {1, 1, 1}, false);
  const RayScene scene(mesh);
  LightRig rig = one_sun({1, 1, 0}, 0.3f);
  rig.sky.radiance = glm::vec3(1);
  const DirectLight light(scene, rig);
  const auto first = light.irradiance({0, 0, 0}, kUp, {}, 5);
  const auto again = light.irradiance({0, 0, 0}, kUp, {}, 5);
  const auto other = light.irradiance({0, 0, 0}, kUp, {}, 6);
  CHECK((first.local == again.local && first.sky == again.sky));
  CHECK((first.local != other.local || first.sky != other.sky));
}

TEST_CASE("direct light: the numbers of rays may be 0", "[scene][lights]") {
  const Mesh mesh = ground(10);
  const RayScene scene(mesh);
  LightRig rig = one_sun({0, 1, 0}, 0.3f);
  rig.sky.radiance = glm::vec3(1);
  const DirectLight light(scene, rig);
  const auto result = light.irradiance({0, 0, 0}, kUp, {0, 0, 0}, 5);
  CHECK(result.local == glm::vec3(0));
  CHECK(result.sky == glm::vec3(0));
}

TEST_CASE("direct light: the result is finite whatever the arguments", "[scene][lights]") {
  Mesh mesh = ground(1);
  mesh.materials[0].emission = {1, 2, 3};
  const RayScene scene(mesh);
  LightRig rig = one_sun({0, 1, 0}, 0.3f);
  rig.sky.radiance = glm::vec3(1);
  rig.points.push_back({{0, 1, 0}, glm::vec3(1e30f)});
  rig.spots.push_back({.position = {0, 1, 0}, .intensity = glm::vec3(1e30f)});
  const DirectLight light(scene, rig);
  const float odd[] = {0,
                       1,
                       -1,
                       1e-38f,
                       1e30f,
                       3e38f,
                       std::numeric_limits<float>::infinity(),
                       std::numeric_limits<float>::quiet_NaN()};
  for (const float a : odd) {
    for (const float b : odd) {
      for (const glm::vec3& v : {glm::vec3(a, b, 0), glm::vec3(0, a, b), glm::vec3(b, 0, a)}) {
        const auto at_normal = light.irradiance({0, 1, 0}, v, {}, 1);
        const auto at_place = light.irradiance(glm::dvec3(v), kUp, {}, 1);
        for (const auto& r : {at_normal, at_place}) {
          CHECK(std::isfinite(r.local.x + r.local.y + r.local.z + r.sky.x + r.sky.y + r.sky.z));
        }
      }
    }
  }
}

TEST_CASE("direct light: a rig that makes no sense is refused", "[scene][lights]") {
  const Mesh mesh = ground(1);
  const RayScene scene(mesh);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto refuses = [&](auto&& spoil) {
    LightRig rig = one_sun(kUp, 0);
    rig.points.emplace_back();
    rig.spots.emplace_back();
    spoil(rig);
    CHECK_THROWS_AS(DirectLight(scene, rig), RequestError);
  };
  refuses([](LightRig& r) { r.suns[0].to_sun = glm::vec3(0); });
  refuses([&](LightRig& r) { r.suns[0].irradiance.y = nan; });
  refuses([](LightRig& r) { r.suns[0].irradiance.y = -1; });
  refuses([](LightRig& r) { r.suns[0].angular_radius = 2; });
  refuses([](LightRig& r) { r.points[0].intensity.x = -1; });
  refuses([&](LightRig& r) { r.points[0].position.x = static_cast<double>(nan); });
  refuses([](LightRig& r) { r.spots[0].intensity.z = -1; });
  refuses([](LightRig& r) { r.spots[0].position.y = 1e151; });
  refuses([](LightRig& r) { r.spots[0].direction = glm::vec3(0); });
  refuses([](LightRig& r) { r.spots[0].outer_angle = 0; });
  refuses([](LightRig& r) { r.spots[0].outer_angle = 1.6f; });
  refuses([](LightRig& r) { r.spots[0].inner_angle = 0.9f; });
  refuses([&](LightRig& r) { r.spots[0].inner_angle = nan; });
  refuses([](LightRig& r) { r.sky.up = glm::vec3(0); });
  refuses([&](LightRig& r) { r.sky.radiance.x = nan; });
}

TEST_CASE("direct light: an empty mesh hides nothing", "[scene][lights]") {
  const Mesh mesh = empty_mesh();
  const RayScene scene(mesh);
  LightRig rig = one_sun(kUp, 0);
  rig.sky.radiance = glm::vec3(1);
  const DirectLight light(scene, rig);
  const auto result = light.irradiance({5, 6, 7}, kUp, {}, 1);
  CHECK(result.local.x == Approx(3));
  CHECK(result.sky.x == Approx(kPi).epsilon(1e-5));
}
