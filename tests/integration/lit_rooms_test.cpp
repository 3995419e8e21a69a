// Pictures of rooms, lit in every way, against paths on the mesh: each photon counts once.
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/trigonometric.hpp>

#include "engine/io/image/image.h"
#include "engine/parallel/thread_pool.h"
#include "engine/ptc.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/mesh_reference.h"
#include "engine/scene/ray_scene.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr unsigned kSide = 32;      // pixels along the edges of a picture
constexpr unsigned kPathRays = 64;  // of the paths' first hits, for each half and pixel
constexpr unsigned kSamples = 4;    // of a pixel, as RenderRequest has it
constexpr unsigned kBounces = 4;    // of the light; with 8 the tests took twice as long

enum Materials : std::uint16_t { kWhite, kRed, kGreen, kLamp };

void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
              std::uint16_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
  mesh.triangles.insert(mesh.triangles.end(),
                        {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
  mesh.material_of.insert(mesh.material_of.end(), {material, material});
}

/// A block whose sides face outwards and have their corners in common.
void add_block(Mesh& mesh, const glm::vec3& low, const glm::vec3& size, std::uint16_t material) {
  const glm::vec3 high = low + size;
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (unsigned i = 0; i < 8; ++i) {
    mesh.positions.emplace_back(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y,
                                i & 4 ? high.z : low.z);
  }
  for (const auto& [a, b, c, d] : std::to_array<std::array<std::uint32_t, 4>>(
           {{0, 2, 3, 1}, {0, 4, 6, 2}, {0, 1, 5, 4}, {7, 6, 4, 5}, {7, 3, 2, 6}, {7, 5, 1, 3}})) {
    mesh.triangles.insert(mesh.triangles.end(),
                          {{first + a, first + b, first + c}, {first + a, first + c, first + d}});
    mesh.material_of.insert(mesh.material_of.end(), {material, material});
  }
}

/// Gives every triangle corners of its own, and moves them apart by about `gap`.
void tear_apart(Mesh& mesh, float gap) {
  Mesh torn = mesh;
  torn.positions.clear();
  for (auto& triangle : torn.triangles) {
    for (std::uint32_t& corner : triangle) {
      glm::vec3 p = mesh.positions[corner];
      p.x += gap * static_cast<float>(torn.positions.size() % 5);
      corner = static_cast<std::uint32_t>(torn.positions.size());
      torn.positions.push_back(p);
    }
  }
  mesh = torn;
}

/// A room of 2 x 2 x 2 with a red and a green wall and two blocks, open towards +z.
Mesh room(const glm::vec3& emission) {
  Mesh mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.75F)},
                    {.name = "red", .albedo = {0.6F, 0.05F, 0.05F}},
                    {.name = "green", .albedo = {0.1F, 0.5F, 0.1F}},
                    {.name = "lamp", .albedo = glm::vec3(0.5F), .emission = emission}};
  const glm::vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2);
  add_quad(mesh, {0, 0, 0}, z, x, kWhite);
  add_quad(mesh, {0, 2, 0}, x, z, kWhite);
  add_quad(mesh, {0, 0, 0}, x, y, kWhite);
  add_quad(mesh, {0, 0, 0}, y, z, kRed);
  add_quad(mesh, {2, 0, 0}, z, y, kGreen);
  add_block(mesh, {0.4F, 0, 0.4F}, {0.5F, 1.1F, 0.5F}, kWhite);
  add_block(mesh, {1.1F, 0, 1}, {0.5F, 0.5F, 0.5F}, kWhite);
  return mesh;
}

/// A picture by paths: two independent halves of each pixel, and whether it sees an emitter.
struct Traced {
  std::vector<glm::vec3> a, b;
  std::vector<bool> emits;
};

/// Renders a picture by paths on the mesh, with the rays of the camera that render_picture() has.
Traced trace_picture(const Mesh& mesh, const LightRig& rig, const Camera& camera,
                     unsigned bounces) {
  const RayScene scene(mesh);
  const DirectLight light(scene, rig);
  const LightPaths paths{{1, 1, 1}, bounces, false};
  Traced traced;
  for (auto* half : {&traced.a, &traced.b}) half->resize(std::size_t{kSide} * kSide);
  traced.emits.resize(std::size_t{kSide} * kSide);
  const ThreadPool executor(0);
  std::vector<char> emits(traced.emits.size());
  executor.for_each(traced.a.size(), [&](std::size_t pixel, unsigned) {
    for (unsigned s = 0; s < kSamples; ++s) {
      const auto place = [&](std::size_t at, unsigned sub) {
        return static_cast<float>(at) + (static_cast<float>(sub) + 0.5F) / 2;
      };
      const glm::vec3 along =
          camera.direction(place(pixel % kSide, s % 2), place(pixel / kSide, s / 2));
      const auto hit =
          scene.closest(camera.position, along, 0, std::numeric_limits<double>::infinity());
      emits[pixel] |= !hit;
      if (!hit) continue;
      emits[pixel] |= hit->emission != glm::vec3(0);
      const float turn = hit->front ? 1.0F : -1.0F;
      for (auto* half : {&traced.a, &traced.b}) {
        const std::uint64_t seed = (pixel * kSamples + s) * 2 + (half == &traced.a ? 0 : 1);
        // Clear of both walls where the ray met their edge
        const glm::dvec3 at =
            hit->position + glm::dvec3(turn * hit->geometric_normal - along) * scene.epsilon();
        const DirectLight::Result direct =
            light.irradiance(at, turn * hit->normal, {16, 64, 0}, 77 * seed);
        const RayTraced rest =
            trace_mesh(scene, light, at, turn * hit->normal, kPathRays, paths, seed);
        (*half)[pixel] += hit->albedo * (std::numbers::inv_pi_v<float> / kSamples) *
                          (direct.local + rest.sky + rest.irradiance);
      }
    }
  });
  traced.emits.assign(emits.begin(), emits.end());
  return traced;
}

/// The errors of a picture over the pixels that see no emitter, over the mean of the paths.
struct Errors {
  double bias = 0, rms = 0;
};

/// A camera before the open front of room().
Camera before() {
  return {.position = {1, 1, 5.2},
          .look_at = {1, 1, 0},
          .vertical_fov = 0.6F,
          .width = kSide,
          .height = kSide};
}

/// Builds a scene with default options, renders it with as many bounces as the paths have, and
/// compares both.
Errors compare(const Mesh& mesh, const LightRig& rig, const Camera& camera) {
  const TemporaryDirectory dir;
  Progress silent;
  BuildRequest build{.mesh = std::make_shared<const Mesh>(mesh), .lights = rig};
  build.sampling.count = 100'000;
  build_container(build, dir / "room.ptcx", silent);
  RenderRequest request{{.scene = dir / "room.ptcx", .bounces = kBounces}};
  request.mesh = build.mesh;
  request.lights = rig;
  request.camera = camera;
  render_picture(request, std::array{PictureTarget{dir / "room.exr"}}, silent);
  const Image ours = read_image(dir / "room.exr");
  const Traced traced = trace_picture(mesh, rig, camera, kBounces);
  double sum = 0, difference = 0, square = 0, count = 0;
  for (std::size_t i = 0; i < ours.pixels.size(); ++i) {
    if (traced.emits[i]) continue;
    for (int c = 0; c < 3; ++c) {
      const double a = static_cast<double>(traced.a[i][c]), b = static_cast<double>(traced.b[i][c]),
                   o = static_cast<double>(ours.pixels[i][c]);
      sum += 0.5 * (a + b);
      difference += o - 0.5 * (a + b);
      square += (o - a) * (o - b);
      count += 1;
    }
  }
  return {difference / sum, std::sqrt(std::max(0.0, square / count)) / (sum / count)};
}

/// The errors that a picture may have: those that the project asks for, where a test has no others.
struct Bounds {
  double bias = 0.01, rms = 0.05;
};

void check_errors(const Mesh& mesh, const LightRig& rig, const Camera& camera = before(),
                  const Bounds& bounds = {}) {
  const Errors errors = compare(mesh, rig, camera);
  INFO("mean off by " << 100 * errors.bias << " %, RMS " << 100 * errors.rms << " %");
  CHECK(std::abs(errors.bias) < bounds.bias);
  CHECK(errors.rms < bounds.rms);
}

/// Compares a room of double-sided materials, lit by a lamp that is a box, with paths.
/// @param degrees  by which it is turned about two axes
/// @param closed   whether the solids in it are closed; otherwise both of their sides count
void check_box_lamp(float degrees, bool closed, const Bounds& bounds) {
  // Light goes to and fro between the lamp's top and the ceiling
  Mesh mesh = room({17, 12, 4});
  add_block(mesh, {0.7F, 1.9F, 0.7F}, {0.6F, 0.04F, 0.6F}, kLamp);
  for (Material& material : mesh.materials) material.double_sided = true;
  if (!closed) tear_apart(mesh, 1e-6F);
  const glm::mat4 turn = glm::rotate(glm::rotate(glm::mat4(1), glm::radians(degrees), {0, 1, 0}),
                                     glm::radians(degrees), {1, 0, 0});
  for (glm::vec3& p : mesh.positions) p = glm::mat3(turn) * p;
  Camera camera = before();
  const glm::dmat3 turned{glm::mat3(turn)};
  camera.position = turned * camera.position;
  camera.look_at = turned * camera.look_at;
  camera.up = glm::mat3(turn) * camera.up;
  check_errors(mesh, {}, camera, bounds);
}

}  // namespace

TEST_CASE("lit rooms: a lamp counts once, at any distance from its ceiling",
          "[integration][lit-rooms]") {
  const double spacing = 0.0095;  // of 300,000 surfels
  for (const double spacings : {0.1, 1.0, 10.0, 100.0}) {
    Mesh mesh = room({17, 12, 4});
    const auto height = static_cast<float>(2 - spacings * spacing);
    add_quad(mesh, {0.95F, height, 0.95F}, {0.5F, 0, 0}, {0, 0, 0.4F}, kLamp);
    INFO(spacings << " spacings below the ceiling");
    check_errors(mesh, {});
  }
}

TEST_CASE("lit rooms: double-sided materials and a lamp that is a box",
          "[integration][lit-rooms]") {
  check_box_lamp(0, true, {.bias = 0.01, .rms = 0.06});
}

// Slanted walls of two sides are a little too dark from afar
TEST_CASE("lit rooms: double-sided materials and a lamp that is a box, turned",
          "[integration][lit-rooms]") {
  check_box_lamp(30, true, {.bias = 0.022, .rms = 0.06});
}

TEST_CASE("lit rooms: double-sided materials and a lamp that is a box, turned and torn apart",
          "[integration][lit-rooms]") {
  check_box_lamp(30, false, {.bias = 0.035, .rms = 0.06});
}

TEST_CASE("lit rooms: a tube lights a room", "[integration][lit-rooms]") {
  Mesh mesh = room(glm::vec3(40));
  constexpr int kSides = 12;
  const auto corner = [](int i) {
    const double angle = 2 * std::numbers::pi * i / kSides;
    return glm::vec3(0.3, 1.8 + 0.02 * std::sin(angle), 0.7 + 0.02 * std::cos(angle));
  };
  for (int i = 0; i < kSides; ++i)
    add_quad(mesh, corner(i), {1.4F, 0, 0}, corner(i + 1) - corner(i), kLamp);
  // The tube is drawn too wide, and hides too much of the ceiling that it lights
  check_errors(mesh, {}, before(), {.bias = 0.015});
}

TEST_CASE("lit rooms: a lamp with a texture lights what is near each part of it",
          "[integration][lit-rooms]") {
  // A panel that stands beside the blocks, bright in one corner and black elsewhere
  Mesh mesh = room(glm::vec3(60));
  mesh.uvs.resize(mesh.positions.size(), glm::vec2(0));
  add_quad(mesh, {1.9F, 0.05F, 0.3F}, {0, 0, 1.2F}, {0, 1.2F, 0}, kLamp);
  mesh.uvs.insert(mesh.uvs.end(), {{0, 0}, {1, 0}, {1, 1}, {0, 1}});
  Image picture{.width = 32, .height = 32};
  for (unsigned y = 0; y < 32; ++y) {
    for (unsigned x = 0; x < 32; ++x) {
      const bool bright = x >= 22 && x < 30 && y >= 20 && y < 28;
      picture.pixels.push_back(bright ? glm::vec3(1, 0.7F, 0.4F) : glm::vec3(0.002F));
    }
  }
  mesh.materials[kLamp].emission_texture = std::make_shared<const Texture>(picture);
  check_errors(mesh, {});
}

TEST_CASE("lit rooms: light of the sky comes in through a window", "[integration][lit-rooms]") {
  // Close the front, and leave a window in the right wall
  Mesh mesh = room(glm::vec3(0));
  mesh.triangles.resize(8);
  mesh.material_of.resize(8);
  add_quad(mesh, {2, 0, 0}, {0, 0, 2}, {0, 0.7F, 0}, kGreen);
  add_quad(mesh, {2, 1.5F, 0}, {0, 0, 2}, {0, 0.5F, 0}, kGreen);
  add_quad(mesh, {2, 0.7F, 0}, {0, 0, 0.6F}, {0, 0.8F, 0}, kGreen);
  add_quad(mesh, {2, 0.7F, 1.5F}, {0, 0, 0.5F}, {0, 0.8F, 0}, kGreen);
  add_quad(mesh, {0, 0, 2}, {0, 2, 0}, {2, 0, 0}, kWhite);
  add_block(mesh, {0.4F, 0, 0.4F}, {0.5F, 1.1F, 0.5F}, kWhite);
  Camera within = before();
  within.position = {1, 1, 1.95};
  within.vertical_fov = 1.5F;
  check_errors(mesh, {.sky = {.radiance = {3, 4, 5}}}, within);
}
