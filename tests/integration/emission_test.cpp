// Scenes with points that emit light, through every step that writes a container.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <tuple>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/image/image.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/ptc.h"
#include "engine/shade/lift.h"
#include "engine/verify/salvage.h"
#include "engine/verify/verify.h"
#include "format/point_page.h"
#include "tests/support/channels.h"
#include "tests/support/scenes.h"
#include "tools/bench/shapes/meshes.h"

using namespace ptc;
using namespace ptc::test;
using ptc::bench::add_quad;

namespace {

constexpr glm::vec3 kLamp(3, 2, 0.5F);  // half a dozen bits, which every profile keeps

/// Every third of random surfels emits light; all reflect some.
std::vector<Surfel> lamps(std::size_t count, std::uint64_t seed) {
  std::vector<Surfel> surfels = random_surfels(count, seed);
  for (std::size_t i = 0; i < count; ++i) {
    surfels[i].radiance = glm::vec3(0.25F);
    if (i % 3 == 0) surfels[i].emission = kLamp;
  }
  return surfels;
}

/// A room of 4 x 4 x 4 without walls: a floor, and a lamp of 1 x 1 above its middle.
Mesh lit_floor() {
  Mesh mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.8F)},
                    {.name = "lamp", .albedo = glm::vec3(0), .emission = kLamp}};
  const auto add = [&](const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
                       std::uint16_t material) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
    mesh.triangles.insert(mesh.triangles.end(),
                          {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
    mesh.material_of.insert(mesh.material_of.end(), {material, material});
  };
  add({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, 0);
  add({-0.5F, 2, -0.5F}, {1, 0, 0}, {0, 0, 1}, 1);
  return mesh;
}

/// Returns emission and radiance of all points, in the order of the container.
std::vector<std::pair<glm::vec3, glm::vec3>> light_of(const std::filesystem::path& path) {
  std::vector<std::pair<glm::vec3, glm::vec3>> light;
  for (const Surfel& s : points_of(path)) light.emplace_back(s.emission, s.radiance);
  return light;
}

/// Returns the sum of area times emission.
glm::dvec3 power_of(const std::vector<Surfel>& surfels) {
  glm::dvec3 power(0);
  for (const Surfel& s : surfels) {
    const double area = 2.0 * static_cast<double>(s.radius) * static_cast<double>(s.radius);
    power += area * glm::dvec3(s.emission);
  }
  return power;
}

/// Checks every rule, builds the tree again, and checks that points have room for emission.
void check_sound(const std::filesystem::path& path) {
  INFO(path.filename());
  Progress silent;
  const VerifyReport report = verify_container(path, {.level = VerifyLevel::rebuild}, silent);
  CHECK(report.findings.empty());
  CHECK(report.tree_digest);
  CHECK(ContainerReader(path).header().point_bytes == kEmittingPointBytes);
}

}  // namespace

TEST_CASE("emission: what a mesh emits stays with its points from build to shading and conversion",
          "[integration][emission]") {
  for (const Profile profile : {Profile::exact, Profile::compact}) {
    const TemporaryDirectory dir;
    Progress silent;
    BuildRequest build{.mesh = std::make_shared<const Mesh>(lit_floor()), .profile = profile};
    build.lights = LightRig{.suns = {{{0, 1, 0}, glm::vec3(1), 0}}};
    build.sampling.count = 8000;
    build.sampling.lights.area_rays = 0;
    build.page_shift = 12;
    build.run = {.memory_bytes = std::uint64_t{256} << 20, .threads = 1};
    build_container(build, dir / "a.ptcx", silent);
    check_sound(dir / "a.ptcx");
    const std::vector<Surfel> points = points_of(dir / "a.ptcx");
    for (const Surfel& s : points) {
      REQUIRE(s.emission == (s.position.y > 1 ? kLamp : glm::vec3(0)));
      if (s.position.y > 1) REQUIRE(s.radiance == glm::vec3(0));  // the lamp is black
    }
    CHECK(std::ranges::count_if(points, [](const Surfel& s) { return s.radiance.r > 0; }) > 5000);
    for (int c = 0; c < 3; ++c)
      CHECK(power_of(points)[c] == Approx(double{kLamp[c]}).epsilon(0.01));  // of 1 x 1

    const ShadeRequest shade{
        {.scene = dir / "a.ptcx", .run = {.memory_bytes = std::uint64_t{256} << 20, .threads = 1}}};
    shade_container(shade, dir / "lit.ptcx", silent);
    check_sound(dir / "lit.ptcx");
    const auto light = light_of(dir / "a.ptcx");
    CHECK(light_of(dir / "lit.ptcx") == light);

    // Copy pages, page again, and build the tree again.
    for (const auto& [to, shift] : {std::pair(Profile::exact, std::uint8_t{12}),
                                    {Profile::raw, std::uint8_t{12}},
                                    {Profile::exact, std::uint8_t{16}},
                                    {Profile::compact, std::uint8_t{13}}}) {
      recode_container(ContainerReader(dir / "lit.ptcx"), dir / "out.ptcx",
                       {.profile = to, .page_shift = shift, .run = build.run}, silent);
      check_sound(dir / "out.ptcx");
      const ContainerReader out(dir / "out.ptcx");
      CHECK(out.meta().channels.size() == 5);
      if (to != Profile::compact) CHECK(light_of(dir / "out.ptcx") == light);
      CHECK(power_of(points_of(dir / "out.ptcx")).r == Approx(power_of(points).r).epsilon(0.005));
    }
  }
}

TEST_CASE("emission: a cloud keeps it through a build, a conversion to PLY and another build",
          "[integration][emission]") {
  const TemporaryDirectory dir;
  Progress silent;
  write_ply(dir / "a.ply", lamps(9000, 1), true);
  BuildRequest build{.inputs = {dir / "a.ply"}, .page_shift = 12, .profile = Profile::exact};
  build_container(build, dir / "a.ptcx", silent);
  check_sound(dir / "a.ptcx");
  const auto light = light_of(dir / "a.ptcx");
  CHECK(std::ranges::count(light, std::pair(kLamp, glm::vec3(0.25F))) == 3000);
  CHECK(std::ranges::count(light, std::pair(glm::vec3(0), glm::vec3(0.25F))) == 6000);
  container_to_points(ContainerReader(dir / "a.ptcx"), dir / "b.ply", {}, silent);
  build.inputs = {dir / "b.ply"};
  build_container(build, dir / "b.ptcx", silent);
  check_sound(dir / "b.ptcx");
  CHECK(light_of(dir / "b.ptcx") == light);
  for (std::size_t c = 0; c < 3; ++c) {
    CHECK(ContainerReader(dir / "b.ptcx").superblock().flux[c] ==
          Approx(ContainerReader(dir / "a.ptcx").superblock().flux[c]));
  }
}

TEST_CASE("emission: room for it is made by the first points that emit light, and stays",
          "[integration][emission]") {
  for (const Profile profile : {Profile::exact, Profile::compact}) {
    const TemporaryDirectory dir;
    Progress silent;
    const std::vector<Surfel> dark = random_surfels(7000, 2), bright = lamps(5000, 1);
    write_ply(dir / "dark.ply", dark, false);
    write_ply(dir / "bright.ply", bright, true);
    const auto build = [&](const char* target, const std::vector<std::filesystem::path>& inputs,
                           const char* append) {
      BuildRequest request{.inputs = inputs, .page_shift = 12, .profile = profile};
      if (append) request.append = dir / append;
      build_container(request, dir / target, silent);
    };
    build("dark.ptcx", {dir / "dark.ply"}, nullptr);
    CHECK(ContainerReader(dir / "dark.ptcx").header().point_bytes == kPointBytes);
    build("bright.ptcx", {dir / "bright.ply"}, nullptr);
    build("both.ptcx", {dir / "dark.ply", dir / "bright.ply"}, nullptr);
    build("dark-bright.ptcx", {dir / "bright.ply"}, "dark.ptcx");
    build("bright-dark.ptcx", {dir / "dark.ply"}, "bright.ptcx");
    const auto sorted = [&](const char* name) {
      std::vector<std::tuple<float, float, float, float>> values;
      for (const Surfel& s : points_of(dir / name))
        values.emplace_back(s.radius, s.normal.x, s.emission.r, s.radiance.r);
      std::ranges::sort(values);
      return values;
    };
    for (const char* name : {"both.ptcx", "dark-bright.ptcx", "bright-dark.ptcx"}) {
      check_sound(dir / name);
      CHECK(sorted(name) == sorted("both.ptcx"));
    }
  }
}

TEST_CASE("emission: salvaged points keep it", "[integration][emission]") {
  const TemporaryDirectory dir;
  Progress silent;
  write_scene(dir / "a.ptcx", lamps(3000, 3));
  const ContainerReader whole(dir / "a.ptcx");
  auto light = light_of(dir / "a.ptcx");
  const std::uint32_t lost = 7;
  std::fstream(dir / "a.ptcx", std::ios::in | std::ios::out | std::ios::binary)
      .seekp(static_cast<std::streamoff>(whole.entry(lost).offset + kPageHeaderBytes))
      .write("damage", 6);
  const SalvageReport report = salvage_container(dir / "a.ptcx", dir / "kept.ptcx", {}, silent);
  const auto from = light.begin() + lost * points_per_page(whole.header());
  light.erase(from, from + whole.entry(lost).record_count);
  CHECK(light_of(dir / "kept.ptcx") == light);
  CHECK(report.points == light.size());
  CHECK(report.flux_share == Approx(0.97).margin(0.02));
  check_sound(dir / "kept.ptcx");
}

namespace {

/// A square lamp that looks down.
struct SquareLamp {
  double side, height;
};

/// Returns the irradiance that a lamp of radiance kLamp brings to a place on a floor at y = 0 where
/// nothing is between, W/m^2. Source: Lambert 1760, the irradiance of a polygon.
double lamp_irradiance(const SquareLamp& lamp, const glm::dvec3& place) {
  const double h = 0.5 * lamp.side;
  std::array<glm::dvec3, 4> way{};
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3 corner(i == 1 || i == 2 ? h : -h, lamp.height, i >= 2 ? h : -h);
    way[i] = glm::normalize(corner - place);
  }
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3 across = glm::cross(way[i], way[(i + 1) % 4]);
    sum += std::atan2(glm::length(across), glm::dot(way[i], way[(i + 1) % 4])) * across.y /
           glm::length(across);
  }
  return 0.5 * std::abs(sum) * double{kLamp.r};
}

/// A room of 4 x 2.5 x 4 with a lamp, or without it.
Mesh lamp_room(const SquareLamp& lamp, bool has_lamp, float albedo) {
  Mesh mesh;
  mesh.materials = {
      {.name = "wall", .albedo = glm::vec3(albedo)},
      {.name = "lamp", .albedo = glm::vec3(0), .emission = kLamp, .double_sided = true}};
  const auto h = static_cast<float>(0.5 * lamp.side), y = static_cast<float>(lamp.height);
  add_quad(mesh, {-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, 0);
  add_quad(mesh, {-2, 2.5F, -2}, {4, 0, 0}, {0, 0, 4}, 0);
  add_quad(mesh, {-2, 0, -2}, {4, 0, 0}, {0, 2.5F, 0}, 0);
  add_quad(mesh, {-2, 0, 2}, {0, 2.5F, 0}, {4, 0, 0}, 0);
  add_quad(mesh, {-2, 0, -2}, {0, 2.5F, 0}, {0, 0, 4}, 0);
  add_quad(mesh, {2, 0, -2}, {0, 0, 4}, {0, 2.5F, 0}, 0);
  if (has_lamp) add_quad(mesh, {-h, y, -h}, {2 * h, 0, 0}, {0, 0, 2 * h}, 1);
  return mesh;
}

/// Builds such a room.
/// @param area_rays  0: its lamp lights nothing while it is built
void build_room(const Mesh& mesh, unsigned area_rays, const LightRig& rig,
                const std::filesystem::path& target) {
  BuildRequest build{.mesh = std::make_shared<const Mesh>(mesh), .lights = rig};
  build.sampling.count = 60'000;
  build.sampling.lights.area_rays = area_rays;
  Progress silent;
  build_container(build, target, silent);
}

/// The points of a shaded container.
struct Lit {
  explicit Lit(const std::filesystem::path& path)
      : frame(ContainerReader(path).header().frame),
        surfels(points_of(path)),
        irradiance(values_of(path).at("irradiance")) {}

  /// Returns where the receiver of a point is.
  [[nodiscard]] glm::dvec3 place(std::size_t i) const {
    return lifted(surfels[i], 0.15F, frame).position;
  }

  Frame frame;
  std::vector<Surfel> surfels;
  std::vector<glm::vec3> irradiance;
};

/// The differences of values from what they should be.
struct Differences {
  double sum = 0, wanted = 0, square = 0, wanted_square = 0;

  void add(double value, double should) {
    sum += value;
    wanted += should;
    square += (value - should) * (value - should);
    wanted_square += should * should;
  }
  [[nodiscard]] double mean() const { return sum / wanted; }
  [[nodiscard]] double rms() const { return std::sqrt(square / wanted_square); }
};

}  // namespace

TEST_CASE("emission: lamps light the receivers of a file by rays", "[integration][emission]") {
  // Black walls: what arrives is the light of the lamp, for which there is a formula
  const TemporaryDirectory dir;
  Progress silent;
  {
    std::ofstream file(dir / "floor.xyz");
    for (int i = 0; i < 1600; ++i)
      file << -1.8 + 3.6 / 39 * (i / 40) << " 0 " << -1.8 + 3.6 / 39 * (i % 40) << " 0 1 0\n";
  }
  for (const SquareLamp& lamp :
       {SquareLamp{0.5, 2.48}, SquareLamp{0.1, 0.2}, SquareLamp{1, 2.4}, SquareLamp{3.9, 2.45}}) {
    INFO("a lamp of " << lamp.side << " at " << lamp.height);
    build_room(lamp_room(lamp, true, 0), 16, {}, dir / "a.ptcx");
    ShadeRequest shade{{.scene = dir / "a.ptcx"}};
    shade.receivers = dir / "floor.xyz";
    const LightingReport report = shade_container(shade, dir / "lit.ptcx", silent);
    CHECK(report.lamp_cpu_seconds > 0);
    const Lit floor(dir / "lit.ptcx");
    REQUIRE(floor.irradiance.size() == 1600);
    Differences found;
    for (std::size_t i = 0; i < floor.irradiance.size(); ++i)
      found.add(floor.irradiance[i].r, lamp_irradiance(lamp, floor.place(i)));
    CHECK(found.mean() == Approx(1).epsilon(0.01));
    CHECK(found.rms() < 0.05);
  }
}

TEST_CASE("emission: suns and lamps of the scene light the receivers of a file",
          "[integration][emission]") {
  const TemporaryDirectory dir;
  Progress silent;
  std::ofstream(dir / "floor.xyz") << "0 0.001 0 0 1 0\n1.5 0.001 0 0 1 0\n1.5 0.001 1 0 1 0\n";
  LightRig rig{.suns = {{{0, 1, 0}, glm::vec3(2), 0}}};
  rig.points.push_back({.position = {1.5, 0.5, 0}, .intensity = glm::vec3(0.25F)});
  BuildRequest build{.mesh = std::make_shared<const Mesh>(lit_floor()), .lights = rig};
  build.sampling.count = 20'000;
  build_container(build, dir / "a.ptcx", silent);
  ShadeRequest shade{{.scene = dir / "a.ptcx"}};
  shade.receivers = dir / "floor.xyz";
  shade_container(shade, dir / "lit.ptcx", silent);
  const Lit floor(dir / "lit.ptcx");
  for (std::size_t i = 0; i < floor.irradiance.size(); ++i) {
    const glm::dvec3 at = floor.place(i);
    const glm::dvec3 way = glm::dvec3(1.5, 0.5, 0) - at;
    const double lamp = 0.25 * way.y / std::pow(glm::length(way), 3),
                 sun = std::abs(at.x) < 0.5 ? 0 : 2;  // the lamp of 1 x 1 hides it
    CHECK(floor.irradiance[i].r == Approx(lamp + sun + lamp_irradiance({1, 2}, at)).epsilon(0.03));
  }
  // Also by many threads, each of which reads pages for both kinds of light
  shade.run = {.memory_bytes = std::uint64_t{4} << 30, .threads = 64};
  shade_container(shade, dir / "many.ptcx", silent);
  CHECK(Lit(dir / "many.ptcx").irradiance == floor.irradiance);
  // Past damage there are no rays, which would read what is damaged
  {
    const ContainerReader scene(dir / "a.ptcx");
    std::fstream(dir / "a.ptcx", std::ios::in | std::ios::out | std::ios::binary)
        .seekp(static_cast<std::streamoff>(scene.entry(3).offset + kPageHeaderBytes))
        .write("damage", 6);
  }
  shade.run = {};
  CHECK_THROWS_AS(shade_container(shade, dir / "torn.ptcx", silent), FormatError);
  shade.tolerate_damage = true;
  CHECK(shade_container(shade, dir / "torn.ptcx", silent).lamp_cpu_seconds == 0);
}

TEST_CASE("emission: points of a lit scene have the light of lamps in what they reflect",
          "[integration][emission]") {
  const TemporaryDirectory dir;
  Progress silent;
  BuildRequest build{.mesh = std::make_shared<const Mesh>(lit_floor()),
                     .lights = LightRig{.suns = {{{0, 1, 0}, glm::vec3(2), 0}}}};
  build.sampling.count = 20'000;
  build_container(build, dir / "a.ptcx", silent);
  const ShadeRequest shade{{.scene = dir / "a.ptcx"}};
  shade_container(shade, dir / "own.ptcx", silent);
  const Lit own(dir / "own.ptcx");
  for (std::size_t i = 0; i < own.surfels.size(); ++i) {
    if (own.surfels[i].position.y < 1) REQUIRE(own.irradiance[i].r < 0.01F);
  }
}

TEST_CASE("emission: rays light points that no emitter has lit, in every bounce",
          "[integration][emission]") {
  // As many bounces of light as where the lamp lit the points, and the one by which it does
  const TemporaryDirectory dir;
  Progress silent;
  const SquareLamp lamp{0.5, 2.4};
  const Mesh room = lamp_room(lamp, true, 0.6F);
  build_room(room, 16, {}, dir / "lit.ptcx");
  build_room(room, 0, {}, dir / "dark.ptcx");
  const auto shaded = [&](const char* scene, unsigned bounces) {
    ShadeRequest shade{{.scene = dir / scene, .bounces = bounces}};
    shade_container(shade, dir / "shaded.ptcx", silent);
    return Lit(dir / "shaded.ptcx");
  };
  const Lit lit = shaded("lit.ptcx", 2), dark = shaded("dark.ptcx", 3);
  REQUIRE(lit.surfels.size() == dark.surfels.size());
  Differences found;
  for (std::size_t i = 0; i < lit.surfels.size(); ++i) {
    REQUIRE(lit.surfels[i].position == dark.surfels[i].position);
    if (lit.surfels[i].position.y > 0.1) continue;
    REQUIRE(dark.surfels[i].radiance.r == 0);
    found.add(
        double{dark.irradiance[i].r},
        double{lit.irradiance[i].r} + double{lit.surfels[i].radiance.r} * std::numbers::pi / 0.6);
  }
  CHECK(found.mean() == Approx(1).epsilon(0.01));
  CHECK(found.rms() < 0.05);
}

TEST_CASE("emission: a picture of a mesh without the lamp has its light all the same",
          "[integration][emission][render]") {
  const TemporaryDirectory dir;
  Progress silent;
  const SquareLamp lamp{0.5, 2.48};
  build_room(lamp_room(lamp, true, 0.6F), 16, {}, dir / "a.ptcx");
  const auto picture = [&](bool has_lamp, bool own_mesh) {
    RenderRequest request{{.scene = dir / "a.ptcx", .bounces = 2}};
    if (own_mesh) request.mesh = std::make_shared<const Mesh>(lamp_room(lamp, has_lamp, 0.6F));
    request.camera = Camera{.position = {0, 2, 0.001},
                            .look_at = {0, 0, 0},
                            .vertical_fov = 1.2F,
                            .width = 64,
                            .height = 64};
    render_picture(request, std::array{PictureTarget{dir / "a.exr"}}, silent);
    return read_image(dir / "a.exr");
  };
  const Image whole = picture(true, true), without = picture(false, true);
  Differences found;
  for (unsigned y = 0; y < 64; ++y) {
    for (unsigned x = 0; x < 64; ++x) found.add(without.at(x, y).r, whole.at(x, y).r);
  }
  CHECK(found.mean() == Approx(1).epsilon(0.01));
  CHECK(found.rms() < 0.05);
}

TEST_CASE("emission: a sphere of directions gathers the light of lamps",
          "[integration][emission]") {
  // Rays would bring it by the cosine at a normal, which does not count
  const TemporaryDirectory dir;
  Progress silent;
  build_room(lamp_room({0.5, 1.2}, true, 0), 0, {}, dir / "a.ptcx");
  std::ofstream(dir / "places.xyz") << "0 0.6 0 0 1 0\n0 0.6 0.01 0 -1 0\n0.01 0.6 0 1 0 0\n";
  ShadeRequest shade{{.scene = dir / "a.ptcx"}};
  shade.receivers = dir / "places.xyz";
  shade.lift = 0;
  shade.gather.around.sphere = true;
  CHECK(shade_container(shade, dir / "lit.ptcx", silent).lamp_cpu_seconds == 0);
  const std::vector<glm::vec3> light = Lit(dir / "lit.ptcx").irradiance;
  REQUIRE(light.size() == 3);
  for (const glm::vec3& at : light) CHECK(at.r == Approx(light[0].r).epsilon(0.1));
  CHECK(light[0].r > 0.1F);
}

TEST_CASE("emission: where most of a scene emits, the gather brings that light",
          "[integration][emission]") {
  const TemporaryDirectory dir;
  Progress silent;
  std::vector<Surfel> surfels;
  add_sphere(surfels, glm::dvec3(0), 1, 0.05, glm::vec3(0));
  for (Surfel& s : surfels) {
    s.normal = -s.normal;
    s.emission = glm::vec3(1);
  }
  write_scene(dir / "a.ptcx", surfels);
  const ShadeRequest shade{{.scene = dir / "a.ptcx"}};
  const LightingReport report = shade_container(shade, dir / "lit.ptcx", silent);
  CHECK(report.lamp_cpu_seconds == 0);
  const std::vector<glm::vec3> irradiance = values_of(dir / "lit.ptcx").at("irradiance");
  for (const glm::vec3& light : irradiance)
    REQUIRE(light.r == Approx(std::numbers::pi).epsilon(0.03));
}
