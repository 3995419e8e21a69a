// The path tracer that judges pictures, compared with formulas for light that is known.
#include "tools/bench/references/path_tracer.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/parallel/thread_pool.h"
#include "tests/support/temporary_directory.h"
#include "tools/bench/experiments/rooms.h"

using namespace ptc;
using namespace ptc::bench;
using ptc::test::TemporaryDirectory;

namespace {

void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
              std::uint16_t material = 0) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
  mesh.triangles.insert(mesh.triangles.end(),
                        {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
  mesh.material_of.insert(mesh.material_of.end(), {material, material});
}

/// A closed box of 2 x 2 x 2 around the origin that looks inwards, with a lamp for a ceiling.
Mesh closed_box(const Material& walls, const Material& ceiling) {
  Mesh mesh;
  mesh.materials = {walls, ceiling};
  const glm::vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2), low(-1, -1, -1);
  add_quad(mesh, low, z, x);
  add_quad(mesh, low + y, x, z, 1);
  add_quad(mesh, low, x, y);
  add_quad(mesh, low + z, y, x);
  add_quad(mesh, low, y, z);
  add_quad(mesh, low + x, z, y);
  return mesh;
}

/// A floor of 200 x 200 at y = 0.
Mesh floor_of(float albedo) {
  Mesh mesh;
  mesh.materials = {{.albedo = glm::vec3(albedo)}};
  add_quad(mesh, {-100, 0, -100}, {0, 0, 200}, {200, 0, 0});
  return mesh;
}

constexpr Camera kInside{
    .position = {0, 0, 0.5}, .look_at = {0, 0, -1}, .vertical_fov = 1.2F, .width = 8, .height = 6};
constexpr Camera kDown{.position = {0.3, 2, 0.2},
                       .look_at = {0.3, 0, 0.2},
                       .up = {0, 0, -1},
                       .vertical_fov = 0.01F,
                       .width = 3,
                       .height = 2};

PathPicture trace(const Mesh& mesh, const LightRig& lights, const Camera& camera,
                  const PathOptions& options, unsigned threads = 2) {
  const RayScene scene(mesh);
  const ThreadPool executor(threads);
  Progress silent;
  return trace_paths(scene, lights, camera, options, executor, silent);
}

/// The mean of red over a picture.
double mean(const PathPicture& picture) {
  double sum = 0;
  for (std::size_t i = 0; i < picture.a.size(); ++i)
    sum += static_cast<double>(picture.at(i).x) / static_cast<double>(picture.a.size());
  return sum;
}

}  // namespace

TEST_CASE("paths: where every wall shines alike, each reflection adds its share",
          "[bench][paths]") {
  const Material wall{.albedo = glm::vec3(0.5F), .emission = glm::vec3(2)};
  const Mesh mesh = closed_box(wall, wall);
  double expected = 2, share = 2;
  for (unsigned reflections = 0; reflections < 5; ++reflections, expected += share *= 0.5) {
    CAPTURE(reflections);
    const PathPicture picture =
        trace(mesh, {}, kInside, {.paths = 2048, .reflections = reflections});
    CHECK(mean(picture) == Approx(expected).epsilon(reflections == 0 ? 1e-6 : 0.004));
    CHECK(std::ranges::count(picture.judged, 1) == 0);
  }
}

TEST_CASE("paths: a lamp for a ceiling lights a floor by its view factor", "[bench][paths]") {
  // Look at the middle of the floor, which sees the ceiling at the distance of its edge: between
  // parallel squares of half edge h = 1/2 distances, F = 4 / (2 pi) * 2 h / w atan(h / w),
  // w = sqrt(1 + h^2)
  const Mesh mesh =
      closed_box({.albedo = glm::vec3(0.6F)}, {.albedo = glm::vec3(0), .emission = glm::vec3(3)});
  Camera camera = kDown;
  camera.position = {0, 0, 0};
  camera.look_at = {0, -1, 0};
  const double w = std::sqrt(1.25);
  const double factor = 4 / (2 * std::numbers::pi) * 2 * (0.5 / w) * std::atan(0.5 / w);
  const PathPicture picture = trace(mesh, {}, camera, {.paths = 8192, .reflections = 1});
  CHECK(mean(picture) == Approx(0.6 * 3 * factor).epsilon(0.003));
  CHECK(std::ranges::count(picture.judged, 1) == 6);
}

TEST_CASE("paths: suns, point lights, spot lights and the sky light a floor as formulas say",
          "[bench][paths]") {
  const Mesh mesh = floor_of(0.5F);
  const PathOptions options{.paths = 32, .reflections = 1};
  const double per_irradiance = 0.5 * std::numbers::inv_pi;
  LightRig sun;
  sun.suns.push_back({.to_sun = glm::normalize(glm::vec3(0, 1, 1)), .irradiance = glm::vec3(4)});
  CHECK(mean(trace(mesh, sun, kDown, options)) ==
        Approx(per_irradiance * 4 * std::sqrt(0.5)).epsilon(0.002));
  LightRig point;
  point.points.push_back({.position = {0.3, 3, 0.2}, .intensity = glm::vec3(18)});
  CHECK(mean(trace(mesh, point, kDown, options)) == Approx(per_irradiance * 2).epsilon(0.001));
  LightRig spot;
  spot.spots.push_back({.position = {0.3, 3, 0.2}, .intensity = glm::vec3(18)});
  CHECK(mean(trace(mesh, spot, kDown, options)) == Approx(per_irradiance * 2).epsilon(0.001));
  spot.spots[0].direction = {0, 1, 0};
  CHECK(mean(trace(mesh, spot, kDown, options)) == 0);
  const LightRig sky{.sky = {.radiance = glm::vec3(3)}};
  CHECK(mean(trace(mesh, sky, kDown, options)) == Approx(1.5));
}

TEST_CASE("paths: backs reflect where they are double-sided or seen", "[bench][paths]") {
  // A sheet over the floor whose front looks up; light comes from the floor alone
  LightRig lights;
  lights.points.push_back({.position = {0, 0.1, 0}, .intensity = glm::vec3(1)});
  for (const bool double_sided : {false, true}) {
    Mesh mesh = floor_of(0.5F);
    mesh.materials.push_back({.albedo = glm::vec3(0.5F), .double_sided = double_sided});
    add_quad(mesh, {-50, 1, -50}, {0, 0, 100}, {100, 0, 0}, 1);
    Camera below = kDown;
    below.position = {2, 0.5, 0};
    below.look_at = {2, 0, 0};
    const double once = mean(trace(mesh, lights, below, {.paths = 4096, .reflections = 1}));
    const double thrice = mean(trace(mesh, lights, below, {.paths = 4096, .reflections = 3}));
    CHECK((thrice > 1.05 * once) == double_sided);
    below.look_at = {2, 1, 0};
    CHECK(mean(trace(mesh, lights, below, {.paths = 64, .reflections = 1})) > 0);
  }
}

TEST_CASE("paths: threads change nothing, and halves differ", "[bench][paths]") {
  const Mesh mesh = closed_box({}, {.emission = glm::vec3(1)});
  const PathPicture one = trace(mesh, {}, kInside, {.paths = 64}, 1),
                    four = trace(mesh, {}, kInside, {.paths = 64}, 4);
  CHECK(one.a == four.a);
  CHECK(one.b == four.b);
  CHECK(one.a != one.b);
}

TEST_CASE("rooms: the noise of the paths is no error of the picture", "[bench][rooms]") {
  // The picture is 10 % too bright; the halves are off by 20 % in opposite ways
  PathPicture paths;
  Image ours{20, 10, {}};
  for (int i = 0; i < 200; ++i) {
    const float off = i % 2 == 0 ? 0.2F : -0.2F;
    paths.a.emplace_back(1 + off);
    paths.b.emplace_back(i % 4 < 2 ? 1 + off : 1 - off);
    paths.judged.push_back(i < 160);
    ours.pixels.emplace_back(i < 160 ? 1.1F : 50.0F);
  }
  const RoomRow row = compare_room(ours, paths);
  CHECK(row.judged == Approx(0.8));
  CHECK(row.bias == Approx(0.1));
  CHECK(row.rms == Approx(0.1));
  CHECK(row.noise == Approx(0.2 / std::sqrt(2)));
}

TEST_CASE("rooms: a Cornell box looks as paths show it", "[bench][rooms]") {
  const TemporaryDirectory dir;
  Progress silent;
  RoomsOptions options{.points = 100'000, .size = {32, 24}, .side = 2, .paths = 1024};
  options.pictures = dir / "pictures";
  const Room room = measure_room(parse_scene("cornell"), options, dir.path(), {}, silent);
  CHECK(std::abs(room.row.bias) < 0.01);
  CHECK(room.row.rms < 0.05);
  CHECK(room.row.noise < 0.03);
  CHECK(room.row.hdr_flip < 0.08);
  CHECK(room.row.judged > 0.5);
  CHECK(room.sheet.width == 3 * 32 + 8);
  CHECK(room.sheet.height == 24);
  const Image kept = read_image(dir / "pictures" / "cornell.exr");
  CHECK(kept.width == 32);
  CHECK(kept.height == 24);
}
