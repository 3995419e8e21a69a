// Light of several bounces, compared with a furnace and with path tracing.
#include "engine/pipeline/light/bounces.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <numbers>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/cloud/record.h"
#include "engine/io/image/image.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/scene_record.h"
#include "engine/ptc.h"
#include "engine/scene/mesh_reference.h"
#include "engine/shade/lift.h"
#include "engine/store/container_points.h"
#include "format/error.h"
#include "tests/support/scenes.h"
#include "tools/bench/chart/statistics.h"

using namespace ptc;
using namespace ptc::test;

namespace {

std::size_t entries_in(const TemporaryDirectory& dir) {
  const std::filesystem::directory_iterator entries(dir.path());
  return static_cast<std::size_t>(std::distance(begin(entries), end(entries)));
}

/// The inside of a closed box or sphere with one albedo, in which every point has radiance 1.
std::vector<Surfel> furnace(bool round, float albedo) {
  std::vector<Surfel> surfels;
  if (round) {
    add_sphere(surfels, glm::dvec3(0), 1, 0.04, glm::vec3(1));
    for (Surfel& s : surfels) s.normal = -s.normal;
  } else {
    const glm::dvec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2), low(-1), high(1);
    for (const auto& [u, v] : {std::pair(x, y), std::pair(y, z), std::pair(z, x)}) {
      add_rectangle(surfels, low, u, v, 0.05, glm::vec3(1));
      add_rectangle(surfels, high, -v, -u, 0.05, glm::vec3(1));
    }
  }
  for (Surfel& s : surfels) s.albedo = glm::vec3(albedo);
  return surfels;
}

struct Lit {
  std::unique_ptr<ContainerReader> bounced;
  LightingReport report;
};

Lit bounce(const ContainerReader& scene, unsigned bounces, const TemporaryDirectory& dir,
           unsigned threads = 1) {
  Lit lit;
  Progress silent;
  const ThreadPool executor(threads);
  BounceOptions options;
  options.bounces = bounces;
  options.temp_dir = dir.path();
  lit.bounced = bounce_light(scene, options, executor, lit.report, silent);
  return lit;
}

std::vector<Shading> shade(const ContainerReader& scene, const std::vector<Receiver>& receivers) {
  const ThreadPool executor(1);
  Shader shader(scene, {}, executor);
  std::vector<Shading> results(receivers.size());
  Progress silent;
  shader.shade(receivers, results, silent);
  return results;
}

std::vector<Receiver> all_points(const ContainerReader& scene) {
  std::vector<PointRecord> records(scene.superblock().points);
  ContainerPoints(scene).next(records);
  std::vector<Receiver> receivers;
  for (const PointRecord& r : records)
    receivers.push_back(lifted(to_surfel(r, scene.header().frame), 0.15F, scene.header().frame));
  return receivers;
}

void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
              std::uint16_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
  mesh.triangles.insert(mesh.triangles.end(),
                        {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
  mesh.material_of.insert(mesh.material_of.end(), {material, material});
}

/// Two rooms of 2 x 2 x 2 with a doorway between them, red, green and white. The ceiling of the
/// first emits light; most of the light in the second has met several surfaces.
Mesh two_rooms() {
  Mesh mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.8F)},
                    {.name = "red", .albedo = {0.8F, 0.1F, 0.1F}},
                    {.name = "green", .albedo = {0.1F, 0.8F, 0.1F}},
                    {.name = "lamp", .albedo = glm::vec3(0.5F), .emission = {2, 2, 1.5F}}};
  const glm::vec3 x(1, 0, 0), y(0, 2, 0), z(0, 0, 2);
  add_quad(mesh, {0, 0, 0}, z, 4.0F * x, 0);  // floor
  add_quad(mesh, {0, 2, 0}, 2.0F * x, z, 3);  // ceilings
  add_quad(mesh, {2, 2, 0}, 2.0F * x, z, 0);
  add_quad(mesh, {0, 0, 0}, 4.0F * x, y, 0);  // back
  add_quad(mesh, {0, 0, 2}, y, 4.0F * x, 0);  // front
  add_quad(mesh, {0, 0, 0}, y, z, 1);         // left
  add_quad(mesh, {4, 0, 0}, z, y, 2);         // right
  add_quad(mesh, {1.95F, 0, 0}, 0.6F * z, y,
           0);  // between them: a slab 0.1 thick, a doorway of 0.8
  add_quad(mesh, {2.05F, 0, 0}, y, 0.6F * z, 0);
  add_quad(mesh, {1.95F, 0, 1.2F}, 0.1F * x, y, 0);
  return mesh;
}

BuildRequest rooms_request() {
  BuildRequest request{.mesh = std::make_shared<const Mesh>(two_rooms())};
  request.lights = LightRig{.points = {{{3.2, 1.2, 0.4}, glm::vec3(0.1F)}}};
  request.sampling.count = 20'000;
  request.sampling.lights.area_rays = 0;
  request.run = {.memory_bytes = std::uint64_t{256} << 20, .threads = 1};
  return request;
}

struct Means {
  double ours = 0, traced = 0, rms = 0;  ///< irradiance over RGB; error over the mean by rays
};

/// Compares points of one of the rooms with paths on the mesh.
Means compare_with_paths(const ContainerReader& lit, const DirectLight& light, const RayScene& rays,
                         unsigned bounces, bool second_room) {
  std::vector<Receiver> receivers;
  const std::vector<Receiver> all = all_points(lit);
  for (std::size_t i = 0; i < all.size(); i += 83) {
    const bool near_seam = std::abs(all[i].position.x - 2) < 0.1;
    if (!near_seam && (all[i].position.x > 2) == second_room) receivers.push_back(all[i]);
  }
  const std::vector<Shading> shaded = shade(lit, receivers);
  std::vector<float> ours, traced;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const RayTraced t = trace_mesh(rays, light, receivers[i].position, receivers[i].normal, 1024,
                                   {{1, 0, 4}, bounces}, i);
    for (int c = 0; c < 3; ++c) {
      ours.push_back(shaded[i].irradiance[c]);
      traced.push_back(t.irradiance[c]);
    }
  }
  const ErrorStatistics e = error_statistics(ours, traced);
  return {e.reference_mean + e.bias, e.reference_mean, e.rms / e.reference_mean};
}

}  // namespace

TEST_CASE("bounces: a furnace glows by the geometric series of its albedo",
          "[integration][bounces]") {
  for (const bool round : {true, false}) {
    const TemporaryDirectory dir;
    write_scene(dir / "furnace.ptcx", furnace(round, 0.6F));
    const ContainerReader scene(dir / "furnace.ptcx");
    double series = 0, power = 1;
    for (unsigned n = 1; n <= 4; ++n, power *= 0.6) {
      series += power;
      const Lit lit = bounce(scene, n, dir);
      const ContainerReader& seen = lit.bounced ? *lit.bounced : scene;
      double mean = 0;
      const std::vector<Shading> shaded = shade(seen, all_points(seen));
      for (const Shading& s : shaded)
        mean += static_cast<double>(s.irradiance.r) / static_cast<double>(shaded.size());
      INFO((round ? "sphere" : "box")
           << ", " << n << " bounces: " << mean / (std::numbers::pi * series));
      CHECK(mean == Approx(std::numbers::pi * series).epsilon(0.015));
    }
  }
}

TEST_CASE("bounces: the light in two rooms agrees with path tracing on the mesh",
          "[integration][bounces]") {
  const TemporaryDirectory dir;
  const BuildRequest request = rooms_request();
  Progress silent;
  build_container(request, dir / "rooms.ptcx", silent);
  const ContainerReader scene(dir / "rooms.ptcx");
  const RayScene rays(*request.mesh);
  const DirectLight light(rays, *request.lights);
  double before = 0;
  for (unsigned n = 1; n <= 4; ++n) {
    const Lit lit = bounce(scene, n, dir);
    const ContainerReader& seen = lit.bounced ? *lit.bounced : scene;
    const Means first = compare_with_paths(seen, light, rays, n, false);
    const Means second = compare_with_paths(seen, light, rays, n, true);
    INFO(n << " bounces, lit room " << first.ours << " of " << first.traced << ", rms " << first.rms
           << "; other room " << second.ours << " of " << second.traced << ", rms " << second.rms);
    CHECK(first.ours == Approx(first.traced).epsilon(0.01));
    CHECK(second.ours == Approx(second.traced).epsilon(0.03));
    CHECK(first.rms < 0.05);
    CHECK(second.rms < 0.1);
    CHECK(second.traced > 1.05 * before);  // each bounce counts
    before = second.traced;
  }
}

TEST_CASE("bounces: the light of the points includes the sky once", "[integration][bounces]") {
  const TemporaryDirectory dir;
  Mesh mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.8F)}};
  add_quad(mesh, {0, 0, 0}, {0, 0, 2}, {1.5F, 0, 0}, 0);
  add_quad(mesh, {0, 0, 0}, {0, 1.5F, 0}, {0, 0, 2}, 0);
  BuildRequest request = rooms_request();
  request.mesh = std::make_shared<const Mesh>(mesh);
  request.lights = LightRig{.sky = {.radiance = glm::vec3(1)}};
  request.sampling.count = 6'000;
  Progress silent;
  build_container(request, dir / "corner.ptcx", silent);
  const ContainerReader scene(dir / "corner.ptcx");
  const RayScene rays(*request.mesh);
  const DirectLight light(rays, *request.lights);
  for (unsigned n = 1; n <= 3; ++n) {
    const Lit lit = bounce(scene, n, dir);
    const Means means =
        compare_with_paths(lit.bounced ? *lit.bounced : scene, light, rays, n, false);
    INFO(n << " bounces: " << means.ours << " of " << means.traced);
    CHECK(means.ours == Approx(means.traced).epsilon(0.02));
  }
}

TEST_CASE("bounces: no bounce adds more light than the one before, even between white walls",
          "[integration][bounces]") {
  for (const float albedo : {1.0F, 0.5F, 0.0F}) {
    const TemporaryDirectory dir;
    write_scene(dir / "box.ptcx", furnace(false, albedo));
    const ContainerReader scene(dir / "box.ptcx");
    double before = scene.superblock().flux[0], added = before;
    for (unsigned n = 2; n <= 4; ++n) {
      const Lit lit = bounce(scene, n, dir);
      const double flux = lit.bounced->superblock().flux[0];
      INFO("albedo " << albedo << ", bounce " << n << ": " << (flux - before) / added);
      CHECK(flux - before >= 0);
      // Radiance is rounded to half, which is up to 0.4 % of what a bounce adds here, and all
      // points round alike
      CHECK(flux - before <= added * 1.02 * static_cast<double>(albedo));
      added = flux - before;
      before = flux;
    }
  }
}

TEST_CASE("bounces: points, tree and albedo stay, and one bounce is the scene itself",
          "[integration][bounces]") {
  const TemporaryDirectory dir;
  write_scene(dir / "box.ptcx", furnace(false, 0.5F));
  const ContainerReader scene(dir / "box.ptcx");
  CHECK(bounce(scene, 1, dir).bounced == nullptr);
  const Lit lit = bounce(scene, 3, dir);
  const Superblock &a = scene.superblock(), &b = lit.bounced->superblock();
  CHECK(b.points == a.points);
  CHECK(b.nodes == a.nodes);
  CHECK(b.leaf_points == a.leaf_points);
  CHECK(b.area == a.area);
  std::vector<PointRecord> before(a.points), after(a.points);
  ContainerPoints(scene).next(before);
  ContainerPoints(*lit.bounced).next(after);
  for (std::size_t i = 0; i < before.size(); ++i) {
    REQUIRE(after[i].key == before[i].key);
    REQUIRE(after[i].albedo == before[i].albedo);
    REQUIRE(after[i].radius == before[i].radius);
    REQUIRE(after[i].radiance[0] > before[i].radiance[0]);
  }
  REQUIRE(lit.report.seconds.size() == 2);
  CHECK(lit.report.seconds[0].first == "bounce 1");
  CHECK(lit.report.seconds[1].first == "bounce 2");
  CHECK(lit.report.bounce_cpu_seconds > 0);
}

TEST_CASE("bounces: threads and cap change no byte, and no temporary file is left",
          "[integration][bounces]") {
  const TemporaryDirectory dir;
  write_scene(dir / "box.ptcx", furnace(false, 0.7F));
  Progress silent;
  std::vector<char> first;
  for (const unsigned threads : {1U, 2U, 5U}) {
    ShadeRequest request{{.scene = dir / "box.ptcx", .bounces = 3}};
    request.run = {.memory_bytes = std::uint64_t{50 + 17 * threads} << 20, .threads = threads};
    const LightingReport report = shade_container(request, dir / "lit.ptcx", silent);
    CHECK(report.bounces == 3);
    if (first.empty()) first = bytes_of(dir / "lit.ptcx");
    CHECK(bytes_of(dir / "lit.ptcx") == first);
    CHECK(entries_in(dir) == 2);
  }
  CHECK(ContainerReader(dir / "lit.ptcx").meta().text.at("shading").ends_with(" bounces 3"));
  ShadeRequest once{{.scene = dir / "box.ptcx"}};
  shade_container(once, dir / "lit.ptcx", silent);
  CHECK(ContainerReader(dir / "lit.ptcx").meta().text.at("shading").find("bounces") ==
        std::string::npos);
}

TEST_CASE("bounces: the points of another cloud and pictures receive their light",
          "[integration][bounces]") {
  const TemporaryDirectory dir;
  write_scene(dir / "box.ptcx", furnace(false, 0.5F));
  std::ofstream(dir / "probe.xyz") << "0 0 0 0 1 0\n0.1 0 0 0 1 0\n";
  Progress silent;
  ShadeRequest request{{.scene = dir / "box.ptcx", .bounces = 2}};
  request.receivers = dir / "probe.xyz";
  request.check = {.receivers = 2, .rays = 256};
  const LightingReport report = shade_container(request, dir / "probe.ply", silent);
  CHECK(report.receivers == 2);
  CHECK(report.check->discs.irradiance_mean == Approx(1.5 * std::numbers::pi).epsilon(0.02));
  CHECK(report.check->discs.irradiance_rms < 0.02);
  RenderRequest picture{{.scene = dir / "box.ptcx", .bounces = 2}};
  picture.samples = 1;
  picture.camera =
      Camera{.position = {0, 0, 0.9}, .look_at = {0, 0, -1}, .width = 16, .height = 16};
  picture.check = {.receivers = 50, .rays = 256};
  const LightingReport render =
      render_picture(picture, std::array{PictureTarget{dir / "a.png"}}, silent);
  CHECK(render.check->discs.irradiance_mean == Approx(1.5 * std::numbers::pi).epsilon(0.02));
  CHECK(entries_in(dir) == 4);
}

TEST_CASE("bounces: the light of an emitter counts once in a picture",
          "[integration][bounces][render]") {
  const TemporaryDirectory dir;
  Mesh mesh;
  mesh.materials = {{.name = "furnace", .albedo = glm::vec3(0.5F), .emission = glm::vec3(1)}};
  const glm::vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2), low(-1), high(1);
  for (const auto& [u, v] : {std::pair(x, y), std::pair(y, z), std::pair(z, x)}) {
    add_quad(mesh, low, u, v, 0);
    add_quad(mesh, high, -v, -u, 0);
  }
  std::ofstream obj(dir / "furnace.obj");
  obj << "mtllib furnace.mtl\nusemtl furnace\n";
  std::ofstream(dir / "furnace.mtl") << "newmtl furnace\nKd 0.5 0.5 0.5\nKe 1 1 1\n";
  for (const glm::vec3& p : mesh.positions) obj << "v " << p.x << ' ' << p.y << ' ' << p.z << '\n';
  for (const auto& t : mesh.triangles)
    obj << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  obj.close();
  BuildRequest build{.inputs = {dir / "furnace.obj"}};
  build.sampling.count = 10'000;
  build.sampling.lights.area_rays = 0;
  Progress silent;
  build_container(build, dir / "furnace.ptcx", silent);
  RenderRequest request{{.scene = dir / "furnace.ptcx"}};
  request.meshes = {dir / "furnace.obj"};
  request.samples = 1;
  request.camera =
      Camera{.position = {0, 0, 0.9}, .look_at = {0, 0, -1}, .width = 16, .height = 16};
  double expected = 1;
  for (unsigned n = 1; n <= 3; ++n) {
    request.bounces = n;
    render_picture(request, std::array{PictureTarget{dir / "a.exr"}}, silent);
    expected += std::pow(0.5, n);
    CHECK(static_cast<double>(read_image(dir / "a.exr").pixels[8 * 16 + 8].g) ==
          Approx(expected).epsilon(0.01));
  }
}

TEST_CASE("bounces: a run that fails leaves no file", "[integration][bounces]") {
  const TemporaryDirectory dir;
  Progress silent;
  write_scene(dir / "box.ptcx", furnace(false, 0.5F));
  const std::uint64_t middle = ContainerReader(dir / "box.ptcx").entry(20).offset + 100;
  std::fstream(dir / "box.ptcx", std::ios::in | std::ios::out | std::ios::binary)
      .seekp(static_cast<std::streamoff>(middle))
      .write("damage", 6);
  const ShadeRequest request{{.scene = dir / "box.ptcx", .bounces = 2}};
  CHECK_THROWS_AS(shade_container(request, dir / "lit.ply", silent), FormatError);
  CHECK(entries_in(dir) == 1);
}

TEST_CASE("bounces: rays at emitters and the gather bring the same light",
          "[integration][bounces]") {
  // Light the rooms by rays at their emitters, so that the gather leaves these out, and by the
  // gather alone; the fluxes of both count light that was reflected once or twice
  const TemporaryDirectory dir;
  Progress silent;
  BuildRequest request = rooms_request();
  request.lights = LightRig{};
  std::vector<double> fluxes;
  for (const unsigned area_rays : {0U, 16U}) {
    request.sampling.lights.area_rays = area_rays;
    build_container(request, dir / "rooms.ptcx", silent);
    const ContainerReader scene(dir / "rooms.ptcx");
    CHECK(lit_by_emitters(scene) == (area_rays > 0));
    // Without rays, the first bounce is the emitters' direct light
    const Lit lit = bounce(scene, area_rays > 0 ? 2 : 3, dir);
    double flux = 0;
    std::vector<PointRecord> records(lit.bounced->superblock().points);
    ContainerPoints(*lit.bounced).next(records);
    for (const PointRecord& record : records) {
      const Surfel s = to_surfel(record, scene.header().frame);
      const double r = static_cast<double>(s.radius);
      flux += 2 * r * r * static_cast<double>(s.radiance.r + s.radiance.g + s.radiance.b);
    }
    fluxes.push_back(flux);
  }
  INFO(fluxes[0] << " by the gather, " << fluxes[1] << " by rays");
  CHECK(fluxes[0] == Approx(fluxes[1]).epsilon(0.01));
}
