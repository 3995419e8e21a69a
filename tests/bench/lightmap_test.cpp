// The radiance of surfels, looked up at places on triangles.
#include "tools/bench/references/lightmap.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::bench;
using test::add_rectangle;

namespace {

const glm::vec3 kRed(0.75F, 0.125F, 0),
    kBlue(0, 0.25F, 0.5F);  // values that rgbe stores without rounding

void add_quad(Mesh& mesh, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

/// Sets the radiance of surfels to their place, so that each lookup says where its value is from.
std::vector<Surfel> marked(std::vector<Surfel> surfels) {
  for (Surfel& s : surfels) s.radiance = glm::vec3(s.position) + 1.0F;
  return surfels;
}

}  // namespace

TEST_CASE("lightmap: each quad has the colour of its own surfels, up to its edges",
          "[bench][lightmap]") {
  Mesh mesh{.origin = {1000, -2000, 3000}};
  add_quad(mesh, {0, 0, 0}, {2, 0, 0}, {0, 1, 0});
  add_quad(mesh, {2, 0, 0}, {3, 0, 0}, {0, 1, 0});
  std::vector<Surfel> surfels;
  add_rectangle(surfels, mesh.origin, {2, 0, 0}, {0, 1, 0}, 0.05, kRed);
  add_rectangle(surfels, mesh.origin + glm::dvec3(2, 0, 0), {3, 0, 0}, {0, 1, 0}, 0.05, kBlue);
  const Lightmap map(mesh, surfels, 0.05);
  constexpr int kSteps = 97;
  for (std::uint32_t triangle = 0; triangle < 4; ++triangle) {
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const float u = static_cast<float>(i) / kSteps, v = static_cast<float>(j) / kSteps;
        REQUIRE(map.at(triangle, u, v) == (triangle < 2 ? kRed : kBlue));
      }
    }
  }
}

TEST_CASE("lightmap: u is the weight of the second corner, v that of the third",
          "[bench][lightmap]") {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {4, 0, 0}, {0, 2, 0}};
  mesh.triangles = {{0, 1, 2}};
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {4, 0, 0}, {0, 2, 0}, 0.02, kRed);
  const Lightmap map(mesh, marked(surfels), 0.02);
  for (const auto& [u, v] :
       {std::pair{0.0F, 0.0F}, {1.0F, 0.0F}, {0.0F, 1.0F}, {0.5F, 0.5F}, {0.25F, 0.125F}}) {
    const glm::vec3 at = map.at(0, u, v) - 1.0F;
    CHECK(at.x == Approx(4 * u).margin(0.05));
    CHECK(at.y == Approx(2 * v).margin(0.05));
  }
}

TEST_CASE("lightmap: no place on the far edge is black, whatever the number of texels",
          "[bench][lightmap]") {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0.25, kRed);
  for (int size = 1; size < 60; ++size) {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 0.37F, 0}};
    mesh.triangles = {{0, 1, 2}};
    const Lightmap map(mesh, surfels, 1.0 / size);
    for (float u = 0; u <= 1; u = std::nextafter(u + 0.003F, 2.0F))
      REQUIRE(map.at(0, u, 1 - u) == kRed);
    for (int k = 0; k <= size; ++k) {  // where texels meet
      const float u = static_cast<float>(k) / static_cast<float>(size);
      for (const float near : {std::nextafter(u, 0.0F), u, std::nextafter(u, 1.0F)}) {
        REQUIRE(map.at(0, near, 1 - near) == kRed);
      }
    }
  }
}

TEST_CASE("lightmap: each of two coincident faces takes the surfels that face its way",
          "[bench][lightmap]") {
  Mesh mesh;
  add_quad(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  add_quad(mesh, {0, 0, 0}, {0, 1, 0}, {1, 0, 0});
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0.1, kRed);
  add_rectangle(surfels, {0, 0, 0}, {0, 1, 0}, {1, 0, 0}, 0.1, kBlue);
  const Lightmap map(mesh, surfels, 0.1);
  for (std::uint32_t triangle = 0; triangle < 4; ++triangle) {
    for (const auto& [u, v] : {std::pair{0.1F, 0.1F}, {0.7F, 0.2F}, {0.3F, 0.6F}}) {
      CHECK(map.at(triangle, u, v) == (triangle < 2 ? kRed : kBlue));
    }
  }
}

TEST_CASE("lightmap: a face takes the nearest surfels where none face its way",
          "[bench][lightmap]") {
  Mesh mesh;
  add_quad(mesh, {0, 0, 0}, {0, 1, 0}, {1, 0, 0});
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0.1, kRed);
  CHECK(Lightmap(mesh, surfels, 0.1).at(0, 0.25F, 0.25F) == kRed);
  CHECK(Lightmap(mesh, {}, 0.1).at(0, 0.25F, 0.25F) == glm::vec3(0));
}
