// Sampling a mesh: number, area, evenness and light of the surfels.
#include "engine/scene/sampling/sampler.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "engine/scene/sampling/directions.h"
#include "tests/scene/coverage.h"
#include "tests/scene/meshes.h"

using namespace ptc;

namespace {

std::vector<Surfel> sample(const Mesh& mesh, const SamplingOptions& options,
                           const LightRig& rig = {}, unsigned threads = 2,
                           std::size_t block = 1000) {
  const RayScene scene(mesh);
  const DirectLight light(scene, rig);
  const ThreadPool executor(threads);
  return drain(*sample_mesh(light, scene, options, executor), block);
}

std::vector<Surfel> sample(const Mesh& mesh, std::uint64_t count) {
  SamplingOptions options;
  options.count = count;
  return sample(mesh, options);
}

Mesh cube() {
  Mesh mesh = empty_mesh();
  add_box(mesh, glm::vec3(-0.5f), glm::vec3(0.5f), false);
  return mesh;
}

// A unit square of n strips.
Mesh strips(int n) {
  Mesh mesh = empty_mesh();
  for (int i = 0; i < n; ++i) {
    const float y = static_cast<float>(i) / static_cast<float>(n);
    add_quad(mesh, {0, y, 0}, {1, 0, 0}, {0, 1 / static_cast<float>(n), 0});
  }
  return mesh;
}

// A disc of n needles that meet at its middle.
Mesh fan(int n) {
  Mesh mesh = empty_mesh();
  for (int i = 0; i < n; ++i) {
    const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(n);
    const float b = 2 * kPi * static_cast<float>(i + 1) / static_cast<float>(n);
    add_triangle(mesh, {0, 0, 0}, {std::cos(a), std::sin(a), 0}, {std::cos(b), std::sin(b), 0});
  }
  return mesh;
}

// Two large triangles next to n x n small quads.
Mesh huge_and_tiny(int n) {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  const float step = 1 / static_cast<float>(n);
  for (int i = 0; i < n * n; ++i) {
    add_quad(mesh, {1 + step * static_cast<float>(i % n), step * static_cast<float>(i / n), 0},
             {step, 0, 0}, {0, step, 0});
  }
  return mesh;
}

struct Shape {
  const char* name;
  Mesh mesh;
  double uncovered;  // share of the surface that may be uncovered
};

std::vector<Shape> shapes() {
  return {{"square", strips(1), 0.006},
          {"cube", cube(), 0.008},
          {"sphere", sphere(1, 40), 0.008},
          {"coarse sphere", sphere(1, 6), 0.008},
          {"strips", strips(40), 0.008},
          {"fan", fan(300), 0.01},
          {"huge and tiny", huge_and_tiny(50), 0.008}};
}

bool equal_bytes(const std::vector<Surfel>& a, const std::vector<Surfel>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].position != b[i].position || a[i].normal != b[i].normal ||
        a[i].radius != b[i].radius || a[i].radiance != b[i].radiance ||
        a[i].albedo != b[i].albedo) {
      return false;
    }
  }
  return true;
}

}  // namespace

TEST_CASE("sampler: the count is met within 2 %, and the sum of 2 r^2 is the mesh's area",
          "[scene][sampler]") {
  for (const Shape& shape : shapes()) {
    for (const std::uint64_t count : {1u, 2u, 13u, 100u, 2000u}) {
      const auto surfels = sample(shape.mesh, count);
      INFO(shape.name << " " << count);
      CHECK(static_cast<double>(surfels.size()) ==
            Approx(static_cast<double>(count)).epsilon(0.02));
      CHECK(covered_area(surfels) == Approx(one_sided_area(shape.mesh)).epsilon(1e-6));
    }
  }
}

TEST_CASE("sampler: surfels are evenly spaced and leave next to nothing uncovered",
          "[scene][sampler]") {
  for (const Shape& shape : shapes()) {
    const std::uint64_t count = 10000;
    const auto surfels = sample(shape.mesh, count);
    const Coverage c = measure_coverage(shape.mesh, surfels, spacing_for(shape.mesh, count), 20000);
    INFO(shape.name << ": nearest " << c.nearest_least << " mean " << c.nearest_mean << " +- "
                    << c.nearest_deviation << ", hole " << c.largest_hole << ", uncovered "
                    << c.uncovered);
    CHECK(static_cast<double>(surfels.size()) == Approx(static_cast<double>(count)).epsilon(0.02));
    CHECK(c.uncovered < shape.uncovered);
    CHECK(c.largest_hole < 1.1);
    CHECK(c.nearest_mean > 0.83);  // random points: 0.5
    CHECK(c.nearest_deviation < 0.13);
  }
}

TEST_CASE("sampler: surfels lie on the mesh and have its normals and colours", "[scene][sampler]") {
  Mesh mesh = cube();
  mesh.origin = {3, 4, 5};
  mesh.materials[0].albedo = {0.25f, 0.5f, 0.75f};
  for (const Surfel& s : sample(mesh, 3000)) {
    const glm::dvec3 p = glm::abs(s.position - mesh.origin);
    const double largest = std::max({p.x, p.y, p.z});
    CHECK(largest == 0.5);
    CHECK(glm::dot(glm::dvec3(s.normal), s.position - mesh.origin) == 0.5);
    CHECK(glm::length(s.normal) == 1);
    CHECK(s.albedo == mesh.materials[0].albedo);
    CHECK(s.radiance == glm::vec3(0));
  }
}

TEST_CASE("sampler: a surfel has the mean normal of its patch when the mesh is finer",
          "[scene][sampler]") {
  Mesh mesh = empty_mesh();  // a corrugated square, flat in the mean
  constexpr int kRoofs = 200;
  for (int i = 0; i < kRoofs; ++i) {
    const float x = static_cast<float>(i) / kRoofs, half = 0.5F / kRoofs, height = 0.4F * half;
    add_quad(mesh, {x, 0, 1}, {half, height, 0}, {0, 0, -1});
    add_quad(mesh, {x + half, height, 1}, {half, -height, 0}, {0, 0, -1});
  }
  double tilt = 0;
  const auto surfels = sample(mesh, 400);
  for (const Surfel& s : surfels) tilt += 1 - static_cast<double>(s.normal.y);
  CHECK(tilt < 0.025 * static_cast<double>(surfels.size()));  // 0.07 with the normals of the roofs
}

TEST_CASE("sampler: surfels extend past an edge about as much as they leave uncovered",
          "[scene][sampler]") {
  const auto surfels = sample(ground(1), 2000);
  const auto covered = [&](float x, float z) {
    return std::ranges::any_of(surfels, [&](const Surfel& s) {
      return glm::distance(s.position, glm::dvec3(x, 0, z)) < static_cast<double>(s.radius);
    });
  };
  Random random(1);
  const double spacing = 2 / std::sqrt(2000.0);
  double net = 0;  // in units of the spacing times the length of the edge
  constexpr int kProbes = 4000;
  for (int i = 0; i < kProbes; ++i) {
    const auto along = static_cast<float>(random.between(-0.9, 0.9)),
               off = static_cast<float>(random.unit() * spacing);
    net += (covered(1 + off, along) ? 1.0 : 0.0) / kProbes;
    net -= (covered(along, 1 - off) ? 0.0 : 1.0) / kProbes;
  }
  CHECK(std::abs(net) < 0.05);  // 0.2 with the discs about their middles
}

TEST_CASE("sampler: surfaces inside a solid give no surfels", "[scene][sampler]") {
  Mesh mesh = cube();
  const auto alone = sample(mesh, 3000);
  add_box(mesh, glm::vec3(-0.25F), glm::vec3(0.25F), false);
  SamplingOptions options;
  options.spacing = spacing_for(cube(), 3000);
  for (const Surfel& s : sample(mesh, options)) CHECK(glm::length(s.position) >= 0.5);
  CHECK(sample(mesh, options).size() == Approx(alone.size()).epsilon(0.02));
}

TEST_CASE("sampler: a surfel's light is the mean over its patch without the buried part",
          "[scene][sampler]") {
  Mesh mesh = ground(1);
  LightRig rig;
  rig.suns.push_back({{0, 1, 0}, glm::vec3(kPi), 0});
  add_box(mesh, {-2, 1, -2}, {0.01F, 2, 2}, false);  // its sharp shadow ends at x = 0.01
  SamplingOptions options;
  options.count = 3000;
  int between = 0;
  for (const Surfel& s : sample(mesh, options, rig)) {
    if (s.position.y == 0) between += s.radiance.x > 0.01F && s.radiance.x < 0.49F ? 1 : 0;
  }
  CHECK(between > 5);
  Mesh half = ground(1);
  add_box(half, {-2, -1, -2}, {0.01F, 2, 2}, false);  // stands over one half
  rig.suns.clear();
  rig.sky.radiance = glm::vec3(1);
  for (const Surfel& s : sample(half, options, rig)) {
    if (s.position.y == 0 && s.position.x < 1 && s.position.x > -1) CHECK(s.radiance.x > 0.05F);
  }
}

TEST_CASE("sampler: a given spacing gives as many surfels as its square fits into the area",
          "[scene][sampler]") {
  SamplingOptions options;
  options.spacing = 0.05;
  options.count = 5;
  const auto surfels = sample(cube(), options);
  CHECK(surfels.size() == 2400);
  for (const Surfel& s : surfels) CHECK(s.radius == Approx(0.05 * std::sqrt(0.5)).epsilon(0.35));
}

TEST_CASE("sampler: radiance is albedo over pi times irradiance, and emission stays apart",
          "[scene][sampler]") {
  Mesh mesh = ground(1);
  mesh.materials[0].albedo = {0.5f, 0.25f, 1};
  mesh.materials[0].emission = {7, 0, 0};
  LightRig rig;
  rig.suns.push_back({glm::normalize(glm::vec3(1, 1, 0)), {2, 2, 2}, 0});
  rig.sky.radiance = {1, 1, 0};
  SamplingOptions options;
  options.count = 500;
  const float sun = 2 * std::sqrt(0.5f);
  for (const Surfel& s : sample(mesh, options, rig)) {
    CHECK(s.radiance.x == Approx(0.5 / kPi * (sun + kPi)).epsilon(1e-4));
    CHECK(s.radiance.y == Approx(0.25 / kPi * (sun + kPi)).epsilon(1e-4));
    CHECK(s.radiance.z == Approx(1 / kPi * sun).epsilon(1e-4));
    CHECK(s.emission == glm::vec3(7, 0, 0));
  }
}

TEST_CASE("sampler: emitters keep their power, and surfaces next to them stay dark",
          "[scene][sampler]") {
  Mesh mesh = ground(1);
  mesh.materials.emplace_back();
  mesh.materials[1].emission = glm::vec3(10);
  mesh.materials[1].albedo = glm::vec3(0);
  add_quad(mesh, {1, 0, 1}, {0.5f, 0, 0}, {0, 0, -2}, 1);  // in one plane with the ground
  double power = 0;
  for (const Surfel& s : sample(mesh, 5000)) {
    CHECK(s.radiance == glm::vec3(0));  // nothing lights the surfels, and emission stays apart
    CHECK((s.emission == glm::vec3(0) || s.emission == glm::vec3(10)));
    CHECK((s.emission.x > 0) == (s.position.x > 1));
    power += 2 * static_cast<double>(s.radius * s.radius * s.emission.x);
  }
  CHECK(power == Approx(10).epsilon(0.01));
  // An emitter smaller than a surfel is not lost either: a surfel takes its power.
  power = 0;
  for (const Surfel& s : sample(mesh, 8)) {
    power += 2 * static_cast<double>(s.radius * s.radius * s.emission.x);
  }
  CHECK(power == Approx(10).epsilon(0.3));
}

TEST_CASE("sampler: a fine texture is averaged over the patch of a surfel", "[scene][sampler]") {
  Mesh mesh = ground(1);
  Image checks{64, 64, {}};
  for (int i = 0; i < 64 * 64; ++i)
    checks.pixels.push_back(glm::vec3((i / 64 + i) % 2 == 0 ? 1.0f : 0));
  mesh.materials[0].texture = std::make_shared<const Texture>(checks);
  mesh.materials[0].albedo = glm::vec3(0.8f);
  for (const glm::vec3& p : mesh.positions) mesh.uvs.emplace_back(p.x, p.z);
  double mean = 0;
  double squares = 0;
  const auto surfels = sample(mesh, 200);
  for (const Surfel& s : surfels) {
    mean += static_cast<double>(s.albedo.x) / static_cast<double>(surfels.size());
    squares += static_cast<double>(s.albedo.x * s.albedo.x) / static_cast<double>(surfels.size());
  }
  CHECK(mean == Approx(0.4).epsilon(0.05));
  CHECK(std::sqrt(squares - mean * mean) < 0.12);  // 0.3 with one look-up
}

TEST_CASE("sampler: a double-sided material gives two surfels back to back, each lit for itself",
          "[scene][sampler]") {
  Mesh mesh = ground(1);
  mesh.materials[0].double_sided = true;
  mesh.materials[0].emission = {5, 5, 5};
  LightRig rig;
  rig.suns.push_back({{0, -1, 0}, glm::vec3(kPi), 0});  // from below
  SamplingOptions options;
  options.count = 4000;
  const auto surfels = sample(mesh, options, rig);
  REQUIRE(surfels.size() == 4000);
  CHECK(covered_area(surfels) == Approx(2 * one_sided_area(mesh)).epsilon(1e-6));
  for (std::size_t i = 0; i < surfels.size(); i += 2) {
    // The front is nearer to who looks at it than the back's rim, also when positions are rounded
    // to a thousandth of a radius, and the pair has a mean normal.
    const glm::dvec3 apart = surfels[i].position - surfels[i + 1].position;
    const float radius = surfels[i + 1].radius;
    CHECK(glm::dot(apart, glm::dvec3(surfels[i].normal)) ==
          Approx(0.04 * static_cast<double>(radius)).epsilon(0.03));
    CHECK(surfels[i].normal == -surfels[i + 1].normal);
    CHECK(surfels[i].radius / radius == Approx(1.0202F).epsilon(1e-4));
    CHECK(surfels[i].emission.x == Approx(5 / 1.02));  // the front emits, and no light reaches it
    CHECK(surfels[i].radiance == glm::vec3(0));
    CHECK(surfels[i + 1].emission == glm::vec3(0));  // the back reflects
    CHECK(surfels[i + 1].radiance.x == Approx(0.5));
  }
}

TEST_CASE("sampler: a mixture of one-sided and double-sided faces keeps number and area",
          "[scene][sampler]") {
  Mesh mesh = cube();
  mesh.materials.emplace_back();
  mesh.materials[1].double_sided = true;
  for (std::size_t i = 0; i < 4; ++i) mesh.material_of[i] = 1;
  for (const std::uint64_t count : {5u, 300u, 5000u}) {
    const auto surfels = sample(mesh, count);
    // Backs in the corners of the cube meet little but one-sided backs, and are buried.
    CHECK(covered_area(surfels) <= 8.00001);
    CHECK(covered_area(surfels) > 7.8);
    if (count > 5) {
      CHECK(static_cast<double>(surfels.size()) ==
            Approx(static_cast<double>(count)).epsilon(0.02));
    }
  }
}

TEST_CASE("sampler: where neither side is buried, double-sided faces have twice their area",
          "[scene][sampler]") {
  Mesh mesh = ground(1);
  mesh.materials.emplace_back();
  mesh.materials[1].double_sided = true;
  add_quad(mesh, {5, 0, 0}, {0, 1, 0}, {0, 0, 2}, 1);
  for (const std::uint64_t count : {5u, 300u, 5000u})
    CHECK(covered_area(sample(mesh, count)) == Approx(8).epsilon(1e-6));
}

TEST_CASE("sampler: the surfels are the same for any number of threads and any block",
          "[scene][sampler]") {
  Mesh mesh = sphere(1, 40);
  add_box(mesh, {1, 0, 0}, {2, 1, 1}, false);
  LightRig rig;
  rig.suns.push_back({glm::normalize(glm::vec3(1, 2, 3)), glm::vec3(1), 0.1f});
  rig.sky.radiance = glm::vec3(1);
  SamplingOptions options;
  options.count = 18000;
  options.lights = {1, 0, 4};
  const auto one = sample(mesh, options, rig, 1, 100000);
  CHECK(equal_bytes(one, sample(mesh, options, rig, 2, 100000)));
  CHECK(equal_bytes(one, sample(mesh, options, rig, 5, 777)));
  CHECK(equal_bytes(one, sample(mesh, options, rig, 2, 1)));
}

TEST_CASE("sampler: in a closed box all surfels are dark to the last bit", "[scene][sampler]") {
  Mesh mesh = empty_mesh();
  add_box(mesh, glm::vec3(-1), glm::vec3(1), true);
  Random random(1);
  turn(mesh, random.rotation());
  LightRig rig;
  for (int i = 0; i < 10; ++i) rig.suns.push_back({random.direction(), glm::vec3(1), 0.1f});
  rig.sky.radiance = glm::vec3(1);
  SamplingOptions options;
  options.count = 10000;
  options.lights = {2, 1, 16};
  int lit = 0;
  for (const Surfel& s : sample(mesh, options, rig)) lit += s.radiance != glm::vec3(0) ? 1 : 0;
  CHECK(lit == 0);
}

TEST_CASE("sampler: ten million metres away the surfels are the same, only moved",
          "[scene][sampler]") {
  Mesh mesh = sphere(1, 20);
  const auto here = sample(mesh, 3000);
  mesh.origin = {1e7, -2e7, 3e7};
  const auto there = sample(mesh, 3000);
  REQUIRE(there.size() == here.size());
  for (std::size_t i = 0; i < here.size(); ++i) {
    CHECK(glm::distance(there[i].position - mesh.origin, here[i].position) < 1e-8);
    CHECK(there[i].radius == here[i].radius);
    CHECK(there[i].normal == here[i].normal);
  }
}

TEST_CASE("sampler: a mesh of another size gives the same surfels at that size",
          "[scene][sampler]") {
  const Mesh mesh = sphere(1, 20);
  const auto surfels = sample(mesh, 3000);
  for (const int exponent : {-40, -8, 8, 40}) {
    const float scale = std::ldexp(1.0f, exponent);
    Mesh scaled = mesh;
    for (glm::vec3& p : scaled.positions) p *= scale;
    const auto others = sample(scaled, 3000);
    REQUIRE(others.size() == surfels.size());
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      CHECK(others[i].position == surfels[i].position * static_cast<double>(scale));
      CHECK(others[i].radius == surfels[i].radius * scale);
    }
  }
}

TEST_CASE("sampler: a mesh without area gives no surfels", "[scene][sampler]") {
  Mesh mesh = empty_mesh();
  CHECK(sample(mesh, 100).empty());
  add_triangle(mesh, {1, 1, 1}, {1, 1, 1}, {1, 1, 1});
  add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {2, 0, 0});
  CHECK(sample(mesh, 100).empty());
  CHECK(spacing_for(mesh, 100) == 0);
  add_triangle(mesh, {0, 0, 0}, {1, 0, 0},
               {0, 1, 0});  // now there are surfels, on this triangle alone
  const auto surfels = sample(mesh, 100);
  CHECK(surfels.size() == 100);
  for (const Surfel& s : surfels) CHECK(s.normal == glm::vec3(0, 0, 1));
}

TEST_CASE("sampler: the spacing for n surfels is the root of area over n", "[scene][sampler]") {
  Mesh mesh = cube();
  CHECK(spacing_for(mesh, 600) == Approx(0.1));
  mesh.materials[0].double_sided = true;
  CHECK(spacing_for(mesh, 1200) == Approx(0.1));
  CHECK_THROWS_AS(spacing_for(mesh, 0), RequestError);
}

TEST_CASE("sampler: invalid options are refused with the name of the one to change",
          "[scene][sampler]") {
  const Mesh mesh = cube();
  const auto refused = [&](auto&& spoil) -> std::string {
    SamplingOptions options;
    options.camera.emplace();
    spoil(options);
    try {
      static_cast<void>(sample(mesh, options));
    } catch (const RequestError& error) {
      CHECK_THAT(error.what(), Catch::Contains("`" + error.field() + "`"));
      return error.field();
    }
    return "none";
  };
  using Options = SamplingOptions;
  CHECK(refused([](Options& o) { o.count = 0; }) == "sampling.count");
  CHECK(refused([](Options& o) { o.count = 1'000'000'000'000; }) == "sampling.count");
  CHECK(refused([](Options& o) { o.spacing = -1; }) == "sampling.spacing");
  CHECK(refused([](Options& o) { o.spacing = 1e-6; }) == "sampling.spacing");
  CHECK(refused([](Options& o) { o.spacing = 1e-300; }) == "sampling.spacing");
  CHECK(refused([](Options& o) { o.spacing = NAN; }) == "sampling.spacing");
  CHECK(refused([](Options& o) { o.pixels_per_surfel = 0; }) == "sampling.pixels_per_surfel");
  CHECK(refused([](Options& o) { o.finest = 0; }) == "sampling.finest");
  CHECK(refused([](Options& o) { o.finest = 1.5f; }) == "sampling.finest");
  CHECK(refused([](Options& o) { o.camera->height = 0; }) == "sampling.camera");
  CHECK(refused([](Options& o) { o.camera->look_at.y = NAN; }) == "sampling.camera");
}

TEST_CASE("sampler: a spacing larger than any mesh gives one surfel or none", "[scene][sampler]") {
  SamplingOptions options;
  for (const double spacing : {1e3, 1e30, 1e300}) {
    options.spacing = spacing;
    const auto surfels = sample(cube(), options);
    CHECK(surfels.size() <= 1);
    for (const Surfel& s : surfels) CHECK(s.radius == Approx(std::sqrt(3)));
  }
}

TEST_CASE("sampler: the first of very many surfels are available at once", "[scene][sampler]") {
  const Mesh mesh = cube();
  const RayScene scene(mesh);
  const DirectLight light(scene, {});
  const ThreadPool executor(1);
  SamplingOptions options;
  options.count = 4'000'000;
  const auto source = sample_mesh(light, scene, options, executor);
  std::vector<Surfel> first(10);
  CHECK(source->next(first) == 10);
}

TEST_CASE("sampler: the inside of an open column is left out, shadows in a closed room are not",
          "[scene][sampler]") {
  // A column without ends, between a floor and a ceiling, both sides of all reflect
  Mesh mesh = empty_mesh();
  add_quad(mesh, {-4, 0, -4}, {0, 0, 8}, {8, 0, 0});
  add_quad(mesh, {-4, 2, -4}, {8, 0, 0}, {0, 0, 8});
  const float s = 0.4F;
  add_quad(mesh, {-s, 0, s}, {2 * s, 0, 0}, {0, 2, 0});
  add_quad(mesh, {s, 0, s}, {0, 0, -2 * s}, {0, 2, 0});
  add_quad(mesh, {s, 0, -s}, {-2 * s, 0, 0}, {0, 2, 0});
  add_quad(mesh, {-s, 0, -s}, {0, 0, 2 * s}, {0, 2, 0});
  mesh.materials[0].double_sided = true;
  const auto sampled = [](const Mesh& of, const LightRig& rig) {
    const RayScene scene(of);
    const DirectLight light(scene, rig);
    const ThreadPool executor(2);
    SamplingOptions options;
    options.count = 8000;
    return drain(*sample_mesh(light, scene, options, executor));
  };
  LightRig sky;
  sky.sky.radiance = glm::vec3(1);
  std::size_t inside = 0, outside = 0;
  for (const Surfel& surfel : sampled(mesh, sky)) {
    const glm::vec3 p(surfel.position);
    if (std::abs(p.x) > 0.42F || std::abs(p.z) > 0.42F || p.y < 0.1F || p.y > 1.9F) continue;
    (glm::dot(surfel.normal, glm::vec3(p.x, 0, p.z)) < 0 ? inside : outside) += 1;
  }
  CHECK(outside > 80);
  CHECK(inside == 0);

  // A box that looks outwards with a lamp and a table in it: what the lamp does not see stays
  Mesh room = empty_mesh();
  add_box(room, glm::vec3(0), glm::vec3(4), false);
  add_quad(room, {1, 1, 1}, {0, 0, 2}, {2, 0, 0});
  room.materials[0].double_sided = true;
  LightRig lamp;
  lamp.points.push_back({.position = {2, 3.9, 2}});
  std::size_t under = 0;
  for (const Surfel& surfel : sampled(room, lamp)) {
    const glm::dvec3& p = surfel.position;
    const bool shaded = surfel.radiance == glm::vec3(0) && p.y < 0.5 && surfel.normal.y > 0.9F;
    under += shaded && p.x > 1.2 && p.x < 2.8 && p.z > 1.2 && p.z < 2.8 ? 1 : 0;
  }
  CHECK(under > 30);
}
