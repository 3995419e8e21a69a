// Four meshes that are made from formulas and fixed seeds, so that they are equal on every
// machine.
//
// fractal: octaves of value noise, each twice as fine and half as high as the one before, give the
// height of a terrain and the displacement of the balls on it. A third of the triangles are balls.
//
// window: a room of boxes, which share no vertices. From above, x to the right and z downwards:
//
//                white
//         +---------------------+
//         |     +-------+       |
//     red |     | table |       :  window, with sun, sky and ground beyond
//         |     +-------+  ball :
//         | cupboard            |
//         +---------------------+
//                green
//
// cornell: walls without thickness around two blocks that stand straight, and a lamp.
//
// layers: sheets of tiles over the ground, half of the tiles missing at random.
#include "tools/bench/scenes/procedural.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"

namespace ptc::bench {
namespace {

/// A smooth random field in [-1, 1]: values at the corners of a lattice, blended between them
/// (Perlin 1985, value noise).
float value_noise(const glm::vec3& p, std::uint64_t seed) {
  const glm::vec3 low(std::floor(p.x), std::floor(p.y), std::floor(p.z));
  const glm::vec3 t = p - low;
  const glm::vec3 s = t * t * (3.0F - 2.0F * t);
  float sum = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::uint64_t hash = seed;
    float weight = 1;
    for (int k = 0; k < 3; ++k) {
      const bool high = (corner >> k & 1) != 0;
      hash = splitmix64(
          hash ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(low[k]) + (high ? 1 : 0)));
      weight *= high ? s[k] : 1 - s[k];
    }
    sum += weight * to_unit(static_cast<std::uint32_t>(hash >> 32));
  }
  return 2 * sum - 1;
}

/// The sum of octaves of noise, each twice as fine and half as high as the one before.
float fractal_noise(glm::vec3 p, int octaves, std::uint64_t seed) {
  float sum = 0, height = 1;
  for (int i = 0; i < octaves; ++i) {
    sum += height * value_noise(p, seed + static_cast<std::uint64_t>(i));
    p *= 2.0F;
    height *= 0.5F;
  }
  return sum;
}

void add_triangle(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c,
                  std::uint16_t material) {
  mesh.triangles.push_back({a, b, c});
  mesh.material_of.push_back(material);
}

constexpr float kWidth = 100;  // of the terrain, units

float terrain_height(float x, float z) {
  return 6 * fractal_noise({x / 14, 0.5F, z / 14}, 8, 1);
}

/// Adds a square of terrain, two triangles for each quad.
/// @param side  quads along an edge
void add_terrain(Mesh& mesh, unsigned side) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (unsigned j = 0; j <= side; ++j) {
    for (unsigned i = 0; i <= side; ++i) {
      const float x = kWidth * (static_cast<float>(i) / static_cast<float>(side) - 0.5F);
      const float z = kWidth * (static_cast<float>(j) / static_cast<float>(side) - 0.5F);
      mesh.positions.emplace_back(x, terrain_height(x, z), z);
    }
  }
  for (unsigned j = 0; j < side; ++j) {
    for (unsigned i = 0; i < side; ++i) {
      const std::uint32_t a = first + j * (side + 1) + i;
      add_triangle(mesh, a, a + side + 1, a + 1, 0);
      add_triangle(mesh, a + 1, a + side + 1, a + side + 2, 0);
    }
  }
}

/// A ball of 8 * 4^k triangles: an octahedron whose faces are cut into rows.
struct Ball {
  std::vector<glm::vec3> corners;  // unit
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

Ball make_ball(int rounds) {
  Ball ball{
      {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
      {{2, 4, 0}, {2, 0, 5}, {2, 5, 1}, {2, 1, 4}, {3, 0, 4}, {3, 5, 0}, {3, 1, 5}, {3, 4, 1}}};
  for (int round = 0; round < rounds; ++round) {
    std::map<std::array<std::uint32_t, 2>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, added] = middles.try_emplace({std::min(a, b), std::max(a, b)},
                                                   static_cast<std::uint32_t>(ball.corners.size()));
      if (added) ball.corners.push_back(glm::normalize(ball.corners[a] + ball.corners[b]));
      return at->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& [a, b, c] : ball.triangles) {
      const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    ball.triangles = std::move(finer);
  }
  return ball;
}

/// Adds a ball whose surface noise displaces.
/// @param roughness  height of the noise as a share of the radius; 0: a smooth ball
void add_ball(Mesh& mesh, const Ball& ball, const glm::vec3& centre, float radius, float roughness,
              std::uint64_t seed, std::uint16_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const glm::vec3& direction : ball.corners) {
    const float height =
        roughness > 0 ? 1 + roughness * fractal_noise(2.0F * direction + 40.0F, 5, seed) : 1;
    mesh.positions.push_back(centre + radius * height * direction);
  }
  for (const auto& [a, b, c] : ball.triangles)
    add_triangle(mesh, first + a, first + b, first + c, material);
}

/// Adds a box of 12 triangles that face outwards.
void add_box(Mesh& mesh, const glm::vec3& low, const glm::vec3& high, std::uint16_t material) {
  constexpr std::array<std::array<std::uint32_t, 4>, 6> kQuads{
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (unsigned corner = 0; corner < 8; ++corner) {
    mesh.positions.emplace_back((corner & 1) != 0 ? high.x : low.x,
                                (corner & 2) != 0 ? high.y : low.y,
                                (corner & 4) != 0 ? high.z : low.z);
  }
  for (const auto& [a, b, c, d] : kQuads) {
    add_triangle(mesh, first + a, first + b, first + c, material);
    add_triangle(mesh, first + a, first + c, first + d, material);
  }
}

/// Adds a parallelogram whose front is where u turns to v counter-clockwise.
void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
              std::uint16_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
  add_triangle(mesh, first, first + 1, first + 2, material);
  add_triangle(mesh, first, first + 2, first + 3, material);
}

}  // namespace

LitScene make_fractal(std::uint64_t triangles) {
  // Name the materials
  LitScene scene;
  scene.mesh.materials = {{.name = "terrain", .albedo = {0.55F, 0.5F, 0.4F}},
                          {.name = "moss", .albedo = {0.25F, 0.5F, 0.2F}},
                          {.name = "clay", .albedo = {0.65F, 0.25F, 0.15F}}};
  // Divide the triangles: a third for balls of 2,048, the rest for the terrain
  const Ball ball = make_ball(4);
  const std::uint64_t balls = triangles / 3 / ball.triangles.size();
  const std::uint64_t rest = triangles - balls * ball.triangles.size();
  const auto side = static_cast<unsigned>(std::lround(std::sqrt(static_cast<double>(rest) / 2)));
  add_terrain(scene.mesh, std::max(1U, side));
  // Set the balls on the terrain
  const SquarePoints places(17);
  for (std::uint32_t i = 0; i < balls; ++i) {
    const glm::vec2 at = (places.square(i) - 0.5F) * (0.96F * kWidth);
    const float radius =
        0.5F + 2.5F * static_cast<float>(places.line(i)) * static_cast<float>(places.line(i));
    add_ball(scene.mesh, ball, {at.x, terrain_height(at.x, at.y) + 0.6F * radius, at.y}, radius,
             0.3F, 100 + i, static_cast<std::uint16_t>(1 + i % 2));
  }
  // Add the light and the camera
  scene.lights.suns.push_back({.to_sun = glm::normalize(glm::vec3(0.5F, 0.6F, 0.3F))});
  scene.lights.sky.radiance = {0.6F, 0.7F, 0.9F};
  scene.camera = {.position = {38, 16, 44}, .look_at = {4, -2, 6}, .width = 640, .height = 360};
  return scene;
}

LitScene make_window_room() {
  // Name the materials
  LitScene scene;
  Mesh& mesh = scene.mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.75F)},
                    {.name = "red", .albedo = {0.65F, 0.08F, 0.06F}},
                    {.name = "green", .albedo = {0.12F, 0.5F, 0.12F}},
                    {.name = "wood", .albedo = {0.5F, 0.32F, 0.18F}},
                    {.name = "ground", .albedo = {0.3F, 0.35F, 0.25F}}};
  // Add the room: floor, ceiling and the three whole walls
  const glm::vec3 size(6, 3, 4);
  constexpr float kWall = 0.25F;
  add_box(mesh, {-kWall, -kWall, -kWall}, {size.x + kWall, 0, size.z + kWall}, 3);  // floor
  add_box(mesh, {-kWall, size.y, -kWall}, {size.x + kWall, size.y + kWall, size.z + kWall},
          0);  // ceiling
  add_box(mesh, {-kWall, 0, -kWall}, {0, size.y, size.z + kWall}, 1);
  add_box(mesh, {0, 0, -kWall}, {size.x, size.y, 0}, 0);
  add_box(mesh, {0, 0, size.z}, {size.x, size.y, size.z + kWall}, 2);
  // Add the wall around the window, which is 1.6 x 1.4 m, 0.9 m above the floor
  const glm::vec3 low(size.x, 0.9F, 1.2F), high(size.x + kWall, 2.3F, 2.8F);
  add_box(mesh, {low.x, 0, 0}, {high.x, low.y, size.z}, 0);
  add_box(mesh, {low.x, high.y, 0}, {high.x, size.y, size.z}, 0);
  add_box(mesh, {low.x, low.y, 0}, {high.x, high.y, low.z}, 0);
  add_box(mesh, {low.x, low.y, high.z}, {high.x, high.y, size.z}, 0);
  // Add the furniture, and the ground outside
  add_box(mesh, {1.2F, 0.68F, 1.1F}, {3.0F, 0.74F, 2.1F}, 3);  // table
  for (int leg = 0; leg < 4; ++leg) {
    const glm::vec3 at(leg % 2 == 0 ? 1.25F : 2.89F, 0, leg / 2 == 0 ? 1.15F : 1.99F);
    add_box(mesh, at, at + glm::vec3(0.06F, 0.68F, 0.06F), 3);
  }
  add_box(mesh, {0.02F, 0, 2.9F}, {0.6F, 2.1F, 3.9F}, 3);  // cupboard
  add_ball(mesh, make_ball(5), {3.9F, 0.45F, 2.7F}, 0.45F, 0, 0, 0);
  add_ball(mesh, make_ball(4), {2.0F, 0.92F, 1.6F}, 0.18F, 0.3F, 5, 2);
  add_box(mesh, {size.x + kWall, -kWall, -4}, {size.x + 9, -kWall / 2, 8}, 4);  // ground outside
  // Add the light and the camera
  scene.lights.suns.push_back(
      {.to_sun = glm::normalize(glm::vec3(0.75F, 0.6F, 0.12F)), .irradiance = glm::vec3(30)});
  scene.lights.sky.radiance = {2.0F, 2.4F, 3.0F};
  scene.camera = {.position = {5.6, 1.7, 0.4},
                  .look_at = {1.4, 0.8, 2.6},
                  .vertical_fov = 1.0F,
                  .width = 640,
                  .height = 360};
  return scene;
}

LitScene make_ajar_rooms() {
  // Name the materials
  LitScene scene;
  Mesh& mesh = scene.mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.75F)},
                    {.name = "door", .albedo = {0.6F, 0.45F, 0.3F}},
                    {.name = "floor", .albedo = {0.4F, 0.4F, 0.45F}},
                    {.name = "red", .albedo = {0.65F, 0.1F, 0.08F}},
                    {.name = "lamp", .albedo = glm::vec3(0.5F), .emission = glm::vec3(60, 55, 45)}};
  // Add floor, ceiling and the walls around both rooms, which lie along x
  constexpr float kWall = 0.2F, kHigh = 2.8F, kDeep = 4, kLeft = 4, kRight = 8.2F;
  const float out = -kWall, far = kDeep + kWall, end = kRight + kWall;
  add_box(mesh, {out, out, out}, {end, 0, far}, 2);
  add_box(mesh, {out, kHigh, out}, {end, kHigh + kWall, far}, 0);
  add_box(mesh, {out, 0, out}, {0, kHigh, far}, 0);
  add_box(mesh, {kRight, 0, out}, {end, kHigh, far}, 0);
  add_box(mesh, {0, 0, out}, {kRight, kHigh, 0}, 0);
  add_box(mesh, {0, 0, kDeep}, {kRight, kHigh, far}, 0);
  // Add the wall between them, with a doorway of 0.9 x 2.1 m
  constexpr float kNear = 1.4F, kFar = 2.3F, kDoor = 2.1F;
  add_box(mesh, {kLeft, 0, 0}, {kLeft + kWall, kHigh, kNear}, 0);
  add_box(mesh, {kLeft, 0, kFar}, {kLeft + kWall, kHigh, kDeep}, 0);
  add_box(mesh, {kLeft, kDoor, kNear}, {kLeft + kWall, kHigh, kFar}, 0);
  // Add the door, 4 cm thick and turned by 30 degrees into the lit room
  const glm::vec3 hinge(kLeft + kWall, 0.01F, kNear), up(0, kDoor - 0.02F, 0);
  const glm::vec3 along = 0.89F * glm::vec3(0.5F, 0, 0.8660254F),
                  thick = 0.04F * glm::vec3(0.8660254F, 0, -0.5F);
  add_quad(mesh, hinge, along, up, 1);
  add_quad(mesh, hinge + thick, up, along, 1);
  add_quad(mesh, hinge, up, thick, 1);
  add_quad(mesh, hinge + along, thick, up, 1);
  add_quad(mesh, hinge, thick, along, 1);
  add_quad(mesh, hinge + up, along, thick, 1);
  // Add a table with balls in the dark room, and the lamp in the other
  add_box(mesh, {1, 0.7F, 1.5F}, {2.2F, 0.75F, 3.1F}, 1);
  for (int leg = 0; leg < 4; ++leg) {
    const glm::vec3 at(leg % 2 == 0 ? 1.05F : 2.07F, 0, leg / 2 == 0 ? 1.55F : 2.97F);
    add_box(mesh, at, at + glm::vec3(0.08F, 0.7F, 0.08F), 1);
  }
  add_ball(mesh, make_ball(5), {1.6F, 0.95F, 1.8F}, 0.2F, 0, 0, 0);
  add_ball(mesh, make_ball(5), {1.5F, 0.95F, 2.3F}, 0.2F, 0, 0, 3);
  add_ball(mesh, make_ball(5), {1.7F, 0.95F, 2.8F}, 0.2F, 0, 0, 0);
  add_quad(mesh, {5.6F, kHigh - 0.02F, 1.5F}, {1, 0, 0}, {0, 0, 1}, 4);
  scene.camera = {.position = {0.3, 1.6, 3.7},
                  .look_at = {3.0, 1.0, 1.6},
                  .vertical_fov = 1.0F,
                  .width = 640,
                  .height = 480};
  return scene;
}

LitScene make_cornell(CornellLamp lamp) {
  // Name the materials
  LitScene scene;
  Mesh& mesh = scene.mesh;
  mesh.materials = {{.name = "white", .albedo = glm::vec3(0.75F)},
                    {.name = "red", .albedo = {0.6F, 0.05F, 0.05F}},
                    {.name = "green", .albedo = {0.1F, 0.5F, 0.1F}},
                    {.name = "lamp", .albedo = glm::vec3(0.5F), .emission = glm::vec3(17, 12, 4)}};
  for (Material& material : mesh.materials) material.double_sided = lamp == CornellLamp::box;
  // Add floor, ceiling and walls, which face inwards
  const glm::vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2);
  add_quad(mesh, {0, 0, 0}, z, x, 0);
  add_quad(mesh, {0, 2, 0}, x, z, 0);
  add_quad(mesh, {0, 0, 0}, x, y, 0);
  add_quad(mesh, {0, 0, 0}, y, z, 1);
  add_quad(mesh, {2, 0, 0}, z, y, 2);
  // Add the blocks and the lamp
  add_box(mesh, {0.4F, 0, 0.4F}, {0.9F, 1.1F, 0.9F}, 0);
  add_box(mesh, {1.1F, 0, 1}, {1.6F, 0.5F, 1.5F}, 0);
  if (lamp == CornellLamp::flat) {
    add_quad(mesh, {0.75F, 1.99F, 0.8F}, {0.5F, 0, 0}, {0, 0, 0.4F}, 3);
  } else {
    add_box(mesh, {0.7F, 1.9F, 0.7F}, {1.3F, 1.94F, 1.3F}, 3);
  }
  scene.camera = {.position = {1, 1, 5.2},
                  .look_at = {1, 1, 0},
                  .vertical_fov = 0.6F,
                  .width = 640,
                  .height = 480};
  return scene;
}

LitScene make_layers(unsigned layers) {
  constexpr int kTiles = 32;
  LitScene scene;
  Mesh& mesh = scene.mesh;
  mesh.materials = {{.name = "ground", .albedo = glm::vec3(0.6F)},
                    {.name = "red", .albedo = {0.6F, 0.2F, 0.15F}},
                    {.name = "blue", .albedo = {0.2F, 0.3F, 0.6F}}};
  // A square tile in the plane y = low.y that faces up or down
  const auto add_tile = [&mesh](const glm::vec3& low, float width, bool up,
                                std::uint16_t material) {
    const auto a = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(),
                          {low, low + glm::vec3(0, 0, width), low + glm::vec3(width, 0, width),
                           low + glm::vec3(width, 0, 0)});
    add_triangle(mesh, a, up ? a + 1 : a + 2, up ? a + 2 : a + 1, material);
    add_triangle(mesh, a, up ? a + 2 : a + 3, up ? a + 3 : a + 2, material);
  };
  // Lay the ground, and the sheets over it
  add_tile({0, 0, 0}, kTiles, true, 0);
  for (unsigned layer = 1; layer <= layers; ++layer) {
    for (int tile = 0; tile < kTiles * kTiles; ++tile) {
      const std::uint64_t bits =
          splitmix64(std::uint64_t{layer} << 32 | static_cast<std::uint64_t>(tile));
      if ((bits & 1) != 0) continue;
      const glm::vec3 at(static_cast<float>(tile % kTiles), static_cast<float>(layer),
                         static_cast<float>(tile / kTiles));
      add_tile(at, 1, (bits & 2) != 0, (bits & 4) != 0 ? 1 : 2);
    }
  }
  // Add the light and the camera
  scene.lights.suns.push_back({.to_sun = glm::normalize(glm::vec3(0.5F, 0.6F, 0.3F))});
  scene.lights.sky.radiance = {0.6F, 0.7F, 0.9F};
  scene.camera = {.position = {50, 30, 55}, .look_at = {16, 2, 16}, .width = 640, .height = 360};
  return scene;
}

}  // namespace ptc::bench
