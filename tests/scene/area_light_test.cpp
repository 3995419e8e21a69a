// Emissive triangles, compared with the form factor of a rectangle.
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/texture.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

const glm::vec3 kUp(0, 1, 0);

// Returns the form factor from a small patch to a parallel rectangle a x b at distance c, one
// corner of which lies over the patch. Source: Howell, A catalog of radiation heat transfer
// configuration factors, B-4.
double corner_factor(double a, double b, double c) {
  const double x = a / c;
  const double y = b / c;
  const double hx = std::sqrt(1 + x * x);
  const double hy = std::sqrt(1 + y * y);
  return (x / hx * std::atan(y / hx) + y / hy * std::atan(x / hy)) / (2 * kPiDouble);
}

// A square lamp of half width h at a height, which faces down, made of n x n quads.
Mesh lamp(float h, float height, int n, const glm::vec3& radiance) {
  Mesh mesh = ground(50);
  mesh.materials.emplace_back();
  mesh.materials[1].emission = radiance;
  const float step = 2 * h / static_cast<float>(n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      add_quad(mesh, {-h + step * static_cast<float>(i), height, -h + step * static_cast<float>(j)},
               {step, 0, 0}, {0, 0, step}, 1);
    }
  }
  return mesh;
}

struct Spread {
  double mean = 0;
  double deviation = 0;
};

Spread irradiance(const DirectLight& light, const glm::dvec3& at, const glm::vec3& normal,
                  int runs) {
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < runs; ++i) {
    const auto x = static_cast<double>(
        light.irradiance(at, normal, {}, static_cast<std::uint64_t>(i)).local.x);
    sum += x / runs;
    squares += x * x / runs;
  }
  return {sum, std::sqrt(std::max(0.0, squares - sum * sum))};
}

}  // namespace

TEST_CASE("area light: a square overhead gives pi times radiance times its form factor",
          "[scene][lights]") {
  for (const int n : {1, 3, 12}) {  // 2, 18 and 288 triangles: more than 64 are drawn by power
    for (const float height : {0.02f, 0.3f, 2.0f, 30.0f}) {
      const Mesh mesh = lamp(1, height, n, {2, 3, 4});
      const RayScene scene(mesh);
      const DirectLight light(scene, {});
      const double expected = 2 * kPiDouble * 4 * corner_factor(1, 1, static_cast<double>(height));
      const Spread found = irradiance(light, {0, 0, 0}, kUp, 400);
      // Few near emitters are sampled among many far ones: this is noisy until all are near or far.
      const bool is_noisy = n == 12 && height < 0.1f;
      CHECK(found.mean == Approx(expected).epsilon(is_noisy ? 0.15 : 0.02));
      CHECK(found.deviation < (is_noisy ? 1 : 0.25) * expected);
    }
  }
}

TEST_CASE("area light: the light is exact next to the lamp and beyond it, too", "[scene][lights]") {
  const Mesh mesh = lamp(1, 1, 2, glm::vec3(1));
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  for (const double x : {0.5, 1.0, 2.0, 6.0}) {
    // Subtract the rectangle to x - 1 from the one to x + 1; both have a corner over the point.
    const double near = std::copysign(corner_factor(std::abs(x - 1), 1, 1), x - 1);
    const double expected = kPiDouble * 2 * (corner_factor(x + 1, 1, 1) - (x == 1 ? 0 : near));
    CHECK(irradiance(light, {x, 0, 0}, kUp, 400).mean == Approx(expected).epsilon(0.02));
  }
}

TEST_CASE("area light: a floor gets the light of the part of a lamp above its horizon",
          "[scene][lights]") {
  // A lamp that faces -x and reaches through the floor, seen from the floor.
  Mesh mesh = ground(50);
  mesh.materials.emplace_back();
  mesh.materials[1].emission = glm::vec3(1);
  add_quad(mesh, {1, -2, -1}, {0, 0, 2}, {0, 4, 0}, 1);
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  // The patch is perpendicular to a rectangle of height a and width b, at distance c (Howell
  // B-5): (atan(b / c) - c / sqrt(a^2 + c^2) atan(b / sqrt(a^2 + c^2))) / 2 pi; twice, for both
  // sides.
  const double diagonal = std::sqrt(5.0);
  const double factor = (std::atan(1.0) - std::atan(1 / diagonal) / diagonal) / kPiDouble;
  CHECK(irradiance(light, {0, 0, 0}, kUp, 400).mean == Approx(kPiDouble * factor).epsilon(0.02));
}

TEST_CASE("area light: a lamp shines on its front side only", "[scene][lights]") {
  Mesh mesh = lamp(1, 1, 1, glm::vec3(1));
  mesh.materials[1].double_sided = true;
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  CHECK(light.irradiance({0, 2, 0}, -kUp, {}, 1).local == glm::vec3(0));
  CHECK(light.irradiance({0, 0.5, 0}, kUp, {}, 1).local.x > 1);
  CHECK(light.irradiance({0.3, 1, 0.2}, -kUp, {}, 1).local == glm::vec3(0));  // on itself
}

TEST_CASE("area light: a rig is black without lights, sky and emitters", "[scene][lights]") {
  const Mesh dark = ground(1), bright = lamp(1, 1, 1, glm::vec3(1));
  const RayScene dark_scene(dark), bright_scene(bright);
  CHECK(DirectLight(dark_scene, {}).is_black());
  CHECK(!DirectLight(bright_scene, {}).is_black());
  LightRig rig;
  rig.sky.radiance = glm::vec3(0.1F);
  CHECK(!DirectLight(dark_scene, rig).is_black());
}

TEST_CASE("area light: an object in between hides the lamp", "[scene][lights]") {
  Mesh mesh = lamp(1, 2, 1, glm::vec3(1));
  add_quad(mesh, {-5, 1, -5}, {5, 0, 0}, {0, 0, 10});  // the half x < 0
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  const double whole = kPiDouble * 4 * corner_factor(1, 1, 2);
  CHECK(irradiance(light, {0, 0, 0}, kUp, 400).mean == Approx(whole / 2).epsilon(0.03));
  CHECK(light.irradiance({-3, 0, 0}, kUp, {}, 1).local == glm::vec3(0));
}

TEST_CASE("area light: the texture of a lamp lights as all of its parts do", "[scene][lights]") {
  // A lamp of 2 x 2 at height 1 over a floor, whose texture is bright in one corner
  Mesh mesh;
  mesh.materials = {{.emission = glm::vec3(10)}};
  add_quad(mesh, {-1, 1, -1}, {2, 0, 0}, {0, 0, 2});
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};
  Image picture{.width = 8, .height = 8, .pixels = std::vector<glm::vec3>(64, glm::vec3(0))};
  picture.pixels[8 * 1 + 6] = {1, 0.5F, 0.25F};
  picture.pixels[8 * 6 + 1] = glm::vec3(0.25F);
  mesh.materials[0].emission_texture = std::make_shared<const Texture>(picture);
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  for (const glm::dvec3 at : {glm::dvec3(0.7, 0, 0.6), glm::dvec3(-0.6, 0.8, -0.7)}) {
    // Integrate over the lamp, place by place
    constexpr int kSteps = 400;
    glm::dvec3 wanted(0);
    for (int j = 0; j < kSteps; ++j) {
      for (int i = 0; i < kSteps; ++i) {
        const double u = (i + 0.5) / kSteps, v = (j + 0.5) / kSteps;
        const glm::dvec3 to = glm::dvec3(2 * u - 1, 1, 2 * v - 1) - at;
        const double d2 = glm::dot(to, to);
        wanted += 10.0 * glm::dvec3(sample_texture(picture, glm::vec2(u, v))) *
                  (to.y * to.y / (d2 * d2) * 4 / (kSteps * kSteps));
      }
    }
    glm::dvec3 mean(0);
    for (std::uint64_t seed = 0; seed < 4000; ++seed) {
      mean += glm::dvec3(light.irradiance(at, {0, 1, 0}, {0, 64, 0}, seed).local) / 4000.0;
    }
    INFO(at.x << ": " << mean.r << " of " << wanted.r);
    for (int c = 0; c < 3; ++c) CHECK(mean[c] == Approx(wanted[c]).epsilon(0.01));
  }
  // What a ray meets emits what the texture has there
  CHECK(scene.surface(0, 0.5F, 0.5F).emission == 10.0F * sample_texture(picture, {1, 0.5F}));
}

TEST_CASE("area light: lamps of different power add up", "[scene][lights]") {
  Mesh mesh = ground(50);
  double expected = 0;
  Random random(1);
  for (std::uint16_t i = 1; i <= 90; ++i) {
    mesh.materials.emplace_back();
    const auto radiance = static_cast<float>(std::exp(random.between(-3, 3)));
    mesh.materials.back().emission = glm::vec3(radiance);
    const float x = static_cast<float>(random.between(-4, 4));
    const float z = static_cast<float>(random.between(-4, 4));
    const float y = 2 + 0.02f * static_cast<float>(i);
    add_quad(mesh, {x, y, z}, {0.05f, 0, 0}, {0, 0, 0.05f}, i);
    const double square = static_cast<double>(x * x + y * y + z * z);
    expected += 0.0025 * static_cast<double>(radiance * y * y) / (square * square);
  }
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  CHECK(irradiance(light, {0, 0, 0}, kUp, 2000).mean == Approx(expected).epsilon(0.03));
}

TEST_CASE("area light: ten million metres away the light is the same", "[scene][lights]") {
  Mesh mesh = lamp(1, 1, 4, glm::vec3(1));
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  Mesh moved = mesh;
  moved.origin = {1e7, 2e7, -1e7};
  const RayScene moved_scene(moved);
  const DirectLight moved_light(moved_scene, {});
  for (int i = 0; i < 50; ++i) {
    const glm::dvec3 at(0.0625 * i, 0, 0.125);
    const auto seed = static_cast<std::uint64_t>(i);
    const auto here = light.irradiance(at, kUp, {}, seed);
    const auto there = moved_light.irradiance(moved.origin + at, kUp, {}, seed);
    CHECK(there.local.x == Approx(here.local.x).epsilon(1e-5));
  }
}

TEST_CASE("area light: degenerate and black emitters give no light", "[scene][lights]") {
  Mesh mesh = ground(1);
  mesh.materials.emplace_back();
  mesh.materials[1].emission = glm::vec3(1);
  add_triangle(mesh, {0, 1, 0}, {0, 1, 0}, {1, 1, 0}, 1);
  add_triangle(mesh, {0, 1, 0}, {0, 1, 1}, {0, 1, 2}, 1);
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  CHECK(light.irradiance({0, 0, 0}, kUp, {}, 1).local == glm::vec3(0));
}

namespace {

/// Small emitters in a box of 4 x 2.5 x 4 above a floor, which look any way.
std::vector<Emitter> scattered(std::size_t count) {
  Random random(5);
  const auto vector = [&](double extent) {
    return glm::vec3(random.between(-extent, extent), random.between(-extent, extent),
                     random.between(-extent, extent));
  };
  std::vector<Emitter> emitters;
  while (emitters.size() < count) {
    const glm::vec3 at(random.between(-2, 2), random.between(0, 2.5), random.between(-2, 2));
    emitters.push_back({{at, at + vector(0.03), at + vector(0.03)},
                        glm::vec3(static_cast<float>(std::exp(random.between(0, 4))))});
  }
  return emitters;
}

/// A lamp of 4 x 4 at a height above a floor, in squares of two triangles.
std::vector<Emitter> wide_lamp(float height, int squares) {
  std::vector<Emitter> emitters;
  const float side = 4.0F / static_cast<float>(squares);
  const glm::vec3 x(side, 0, 0), z(0, 0, side);
  for (int i = 0; i < squares * squares; ++i) {
    const glm::vec3 at(-2 + side * static_cast<float>(i % squares), height,
                       -2 + side * static_cast<float>(i / squares));
    emitters.push_back({{at, at + x, at + x + z}, glm::vec3(1)});
    emitters.push_back({{at, at + x + z, at + z}, glm::vec3(1)});
  }
  return emitters;
}

/// The light of emitters at places on a floor, from some samples each, against many.
struct Noise {
  double mean = 0;  ///< over what it should be
  double rms = 0;   ///< over the root of the mean square
};

/// @param wanted  returns the irradiance of a place
template <class Wanted>
Noise noise_of(const AreaLights& lights, const Wanted& wanted) {
  Random random(7);
  double sum = 0, square = 0, all = 0, all_square = 0;
  std::vector<EmitterSample> samples;
  for (std::uint64_t place = 0; place < 100; ++place) {
    const glm::vec3 at(random.between(-1.8, 1.8), 0, random.between(-1.8, 1.8));
    const double should = wanted(at);
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      lights.sample(at, kUp, 16, 20 * place + seed, 0, samples);
      double light = 0;
      for (const EmitterSample& sample : samples) light += double{sample.irradiance.x};
      sum += light;
      square += (light - should) * (light - should);
      all += should;
      all_square += should * should;
    }
  }
  return {sum / all, std::sqrt(square / all_square)};
}

}  // namespace

TEST_CASE("area light: 16 rays tell the light of thousands of emitters", "[scene][lights]") {
  // A wide lamp is compared with the formula for the corners of the whole square
  for (const auto& [height, most] : {std::pair(0.3F, 0.08), {0.6F, 0.04}, {2.0F, 0.008}}) {
    const AreaLights lights(wide_lamp(height, 60));
    const auto formula = [&](const glm::vec3& at) {
      double sum = 0;
      for (const double x : {2.0 - double{at.x}, 2.0 + double{at.x}}) {
        for (const double z : {2.0 - double{at.z}, 2.0 + double{at.z}})
          sum += kPiDouble * corner_factor(x, z, double{height});
      }
      return sum;
    };
    const Noise noise = noise_of(lights, formula);
    INFO("height " << height << ": mean " << noise.mean << ", RMS " << noise.rms);
    CHECK(noise.mean == Approx(1).epsilon(0.01));
    CHECK(noise.rms < most);
  }
  // Scattered emitters are compared with the sum of what each brings alone
  const std::vector<Emitter> emitters = scattered(2000);
  std::vector<AreaLights> each;
  for (const Emitter& emitter : emitters) each.emplace_back(std::vector<Emitter>{emitter});
  const auto one_by_one = [&](const glm::vec3& at) {
    double sum = 0;
    std::vector<EmitterSample> samples;
    for (const AreaLights& light : each) {
      light.sample(at, kUp, 64, 1, 0, samples);
      for (const EmitterSample& sample : samples) sum += double{sample.irradiance.x};
    }
    return sum;
  };
  const Noise noise = noise_of(AreaLights(emitters), one_by_one);
  INFO("scattered: mean " << noise.mean << ", RMS " << noise.rms);
  CHECK(noise.mean == Approx(1).epsilon(0.03));
  CHECK(noise.rms < 0.35);
}

TEST_CASE("area light: however few rays are cast, each emitter has its share", "[scene][lights]") {
  // Two wide lamps side by side, of which one might be hidden: its light alone must be right
  std::vector<Emitter> emitters = wide_lamp(1, 12);
  const std::size_t half = emitters.size() / 2;
  const auto is_near = [](const EmitterSample& sample) { return sample.position.z < 0; };
  std::vector<Emitter> near;
  for (const Emitter& emitter : emitters) {
    if (emitter.corner[0].z + emitter.corner[1].z + emitter.corner[2].z < 0)
      near.push_back(emitter);
  }
  REQUIRE(near.size() == half);
  const AreaLights all(emitters), alone(near);
  const glm::vec3 at(0.3F, 0, 0.4F);
  std::vector<EmitterSample> samples;
  alone.sample(at, kUp, 16384, 1, 0, samples);
  double wanted = 0;
  for (const EmitterSample& sample : samples) wanted += double{sample.irradiance.x};
  for (const unsigned count : {1U, 2U, 4U, 8U, 16U, 64U}) {
    double sum = 0;
    constexpr std::uint64_t kSeeds = 20'000;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      all.sample(at, kUp, count, seed, count * (seed % 4), samples);
      for (const EmitterSample& sample : samples) {
        if (is_near(sample)) sum += double{sample.irradiance.x} / double{kSeeds};
      }
    }
    INFO(count << " samples: " << sum << " of " << wanted);
    CHECK(sum == Approx(wanted).epsilon(0.01));
  }
}
