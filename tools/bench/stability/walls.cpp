// Rows of walls that have to keep light out, or show each side its own.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>

#include "engine/base/numbers.h"
#include "tools/bench/shapes/meshes.h"
#include "tools/bench/shapes/random.h"
#include "tools/bench/shapes/surfels.h"
#include "tools/bench/stability/form_factors.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

/// Adds true values: half of the rows white, the other half black.
void add_white_and_black(unsigned rows, Field& field) {
  for (const double light : {1.0, 0.0}) {
    const auto half = grey(std::size_t{rows} / 2 * field.width, light);
    field.truth.insert(field.truth.end(), half.begin(), half.end());
  }
}

/// A closed ball from within: no gap between discs may show the sky.
Outcome closed_ball(const Lab& lab) {
  Mesh mesh = sphere(1, 32);
  mesh.materials[0].albedo = glm::vec3(0);
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  const SmallScene scene(lab, mesh, {}, 20'000);
  // In a slice through the ball, up to its surface
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [](double u, double v) {
        const double ring = 0.99 * u, turn = 2 * kPiDouble * v;
        const glm::dvec3 at(ring * std::cos(turn), ring * std::sin(turn), 0);
        return Receiver{at, glm::vec3(-std::cos(turn), -std::sin(turn), 0)};
      });
  const auto ours = values(scene.shade(receivers, white_sky), brightness);
  const auto discs = values(scene.trace(receivers, 256, white_sky), brightness);
  const auto truth = grey(ours.size(), 0);
  return {.figures = {{"sky that leaks in, largest", largest_difference(ours, truth), 0.025},
                      {"sky that leaks in, mean", mean_value(ours), 0.008},
                      {"the same between the discs themselves, mean", mean_value(discs), 0.004}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

/// A bright sheet of one side, seen from behind.
Outcome behind_a_sheet(const Lab& lab) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, 0.02, glm::vec3(1));
  const SmallScene scene(lab, surfels);
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [](double u, double v) {
        const double lean = 2.5 * u - 1.25;
        return Receiver{{u, 0, -0.1 - 2 * v}, glm::vec3(std::sin(lean), 0, std::cos(lean))};
      });
  const auto ours = values(scene.shade(receivers), brightness);
  const auto truth = grey(ours.size(), 0);
  return {.figures = {{"light through the back", largest_difference(ours, truth), 0}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

/// A room whose walls shine within and are black outside, as two sheets of no thickness, turned.
Outcome two_sides(const Lab& lab) {
  constexpr double kSpacing = 0.02;
  constexpr unsigned kRows = 8;
  Outcome outcome{.field = {.width = kReceiversAlong}};
  for (const double degrees : {0.0, 15.0, 30.0, 45.0}) {
    const glm::dmat3 turn(glm::rotate(glm::rotate(glm::dmat4(1), glm::radians(degrees), {0, 1, 0}),
                                      glm::radians(degrees), {1, 0, 0}));
    std::vector<Surfel> inside, surfels;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 u(0), v(0), n(0);
      u[(axis + 1) % 3] = v[(axis + 2) % 3] = n[axis] = 2;
      add_rectangle(inside, {-1, -1, -1}, u, v, kSpacing, glm::vec3(1));
      add_rectangle(inside, glm::dvec3(-1) + n, v, u, kSpacing, glm::vec3(1));
    }
    for (Surfel s : inside) {
      s.position = turn * s.position;
      s.normal = glm::vec3(turn * glm::dvec3(s.normal));
      Surfel back = s;
      back.normal = -s.normal;
      back.radiance = glm::vec3(0);
      back.radius *= 0.98F;  // as the sampler makes pairs
      s.position += 0.02 * static_cast<double>(s.radius) * glm::dvec3(s.normal);
      back.position += 0.02 * static_cast<double>(s.radius) * glm::dvec3(back.normal);
      surfels.push_back(s);
      surfels.push_back(back);
    }
    const SmallScene scene(lab, surfels);
    // Half of the rows on the floor within, half below it outside, looking up
    const auto receivers = receivers_on_grid(kReceiversAlong, kRows, [&](double u, double v) {
      const double height = v < 0.5 ? -0.98 : -1.02;
      const glm::dvec3 at(1.8 * u - 0.9, height, 3.2 * (v < 0.5 ? v : v - 0.5) - 0.8);
      return Receiver{turn * at, glm::vec3(turn * glm::dvec3(0, 1, 0))};
    });
    outcome.field.add(scene.shade(receivers), brightness);
    add_white_and_black(kRows, outcome.field);
  }
  outcome.figures = {{"light, RMS error", outcome.field.rms_error(), 0.015},
                     {"light, largest error", outcome.field.largest_error(), 0.04}};
  return outcome;
}

/// The faces of a box: inwards, and around it a shell outwards where it has a thickness.
Mesh box_of_thickness(float thickness) {
  Mesh mesh = empty_mesh();
  mesh.materials[0].albedo = glm::vec3(0.5F);
  add_box(mesh, glm::vec3(-1), glm::vec3(1), true);
  if (thickness > 0) {
    add_box(mesh, glm::vec3(-1 - thickness), glm::vec3(1 + thickness), false);
  } else {
    mesh.materials[0].double_sided = true;
  }
  return mesh;
}

/// Closed boxes, lit by a sun and a sky from outside: E within over E outside. The thicknesses of
/// their walls are shares of a spacing; each box is turned in its own way.
Outcome coffin(const Lab& lab) {
  constexpr std::uint64_t kPoints = 30'000;
  constexpr unsigned kRows = 6;
  Outcome outcome{.field = {.width = kReceiversAlong}};
  Random random(23);
  const double spacing = std::sqrt(24.0 / kPoints);
  LightRig lights;
  lights.suns.push_back({glm::normalize(glm::vec3(1, 2, 3)), glm::vec3(3), 0.005F});
  lights.sky.radiance = glm::vec3(0.3F);
  const double outside = 3 + 0.3 * kPiDouble;
  double within = 0, sum = 0, discs = 0;
  for (const double share : {0.0, 0.1, 0.3, 1.0, 3.0, 10.0}) {
    Mesh mesh = box_of_thickness(static_cast<float>(share * spacing));
    const glm::mat3 rotation = share == 1.0 ? glm::mat3(1) : random.rotation();
    turn(mesh, rotation);
    const SmallScene scene(lab, mesh, lights, kPoints);
    const auto receivers = receivers_on_grid(kReceiversAlong, kRows, [&](double u, double v) {
      // On the floor and on a wall, up to a spacing from the edges
      const bool floor = v < 0.5;
      const double along = 1.96 * u - 0.98, across = 3.8 * (floor ? v : v - 0.5) - 0.95;
      const glm::dvec3 at =
          floor ? glm::dvec3(along, across, -1 + 1e-3) : glm::dvec3(-1 + 1e-3, along, across);
      const glm::dvec3 normal = floor ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
      return Receiver{glm::dmat3(rotation) * at, rotation * glm::vec3(normal)};
    });
    const auto sky = [](const glm::vec3&) { return glm::vec3(0.3F); };
    for (const Shading& shading : scene.trace(receivers, 256, sky))
      discs += static_cast<double>(brightness(shading).g) * kPiDouble / outside;
    for (const Shading& shading : scene.shade(receivers, sky)) {
      const glm::vec3 light = brightness(shading) * static_cast<float>(kPiDouble / outside);
      outcome.field.ours.push_back(light * 10.0F);
      within = std::max(within, double{light.g});
      sum += double{light.g};
    }
    outcome.field.height += kRows;
  }
  outcome.field.truth = grey(outcome.field.ours.size(), 0);
  outcome.figures = {{"light within over that outside, largest", within, 0.01},
                     {"light within over that outside, mean",
                      sum / static_cast<double>(outcome.field.ours.size()), 0.002},
                     {"the same between the discs themselves, mean",
                      discs / static_cast<double>(outcome.field.ours.size()), 0.002}};
  return outcome;
}

/// Thin walls of two closed sides, one white and one black, 10 to 0.1 radii thick.
Outcome thin_walls(const Lab& lab) {
  constexpr double kSpacing = 0.03, kRadius = kSpacing * 0.7071067811865476;
  constexpr unsigned kRows = 6;
  Outcome outcome{.field = {.width = kReceiversAlong}};
  for (const double radii : {10.0, 3.0, 1.0, 0.3, 0.1}) {
    const double half = 0.5 * radii * kRadius;
    std::vector<Surfel> surfels;
    add_rectangle(surfels, {-3, -3, half}, {6, 0, 0}, {0, 6, 0}, kSpacing, glm::vec3(1));
    add_rectangle(surfels, {-3, -3, -half}, {0, 6, 0}, {6, 0, 0}, kSpacing * 1.07, glm::vec3(0));
    const SmallScene scene(lab, surfels);
    // Half of the rows above the white side, half below the black one; all look at the wall
    const auto receivers = receivers_on_grid(kReceiversAlong, kRows, [&](double u, double v) {
      const double side = v < 0.5 ? 1 : -1, away = 0.01 + 0.05 * u;
      return Receiver{{2 * u - 1, v, side * (half + away)}, glm::vec3(0, 0, -side)};
    });
    outcome.field.add(scene.shade(receivers), brightness);
    add_white_and_black(kRows, outcome.field);
  }
  outcome.figures = {{"light, largest error", outcome.field.largest_error(), 0.02},
                     {"light, RMS error", outcome.field.rms_error(), 0.005}};
  return outcome;
}

/// A dark room whose only light is the sky in a slit of its wall.
Outcome slit(const Lab& lab) {
  Mesh mesh = empty_mesh();
  mesh.materials[0].albedo = glm::vec3(0);
  mesh.materials[0].double_sided = true;
  constexpr float kSlit = 0.04F, kSky = 50;
  add_quad(mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  add_quad(mesh, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0});
  add_quad(mesh, {-1, -1, 0}, {0, 2, 0}, {0, 0, 2});
  add_quad(mesh, {-1, -1, 0}, {0, 0, 2}, {2, 0, 0});
  add_quad(mesh, {-1, 1, 0}, {2, 0, 0}, {0, 0, 2});
  add_quad(mesh, {1, -1, 0}, {0, 0, 1}, {0, 2, 0});
  add_quad(mesh, {1, -1, 1 + kSlit}, {0, 0, 1 - kSlit}, {0, 2, 0});
  LightRig lights;
  lights.sky.radiance = glm::vec3(kSky);
  const SmallScene scene(lab, mesh, lights, 60'000);
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [](double u, double v) {
        return Receiver{{1.8 * u - 0.9, 1.8 * v - 0.9, 0.003}, {0, 0, 1}};
      });
  const auto ours =
      values(scene.shade(receivers, [](const glm::vec3&) { return glm::vec3(kSky); }), brightness);
  const std::array<glm::dvec3, 4> opening{
      {{1, -1, 1}, {1, -1, 1 + kSlit}, {1, 1, 1 + kSlit}, {1, 1, 1}}};
  std::vector<glm::vec3> truth;
  for (const Receiver& receiver : receivers)
    truth.emplace_back(kSky * form_factor(receiver, opening));
  return {.figures = {{"light, RMS error over its mean", relative_rms(ours, truth), 0.65},
                      {"light, error of its mean",
                       std::abs(mean_value(ours) / mean_value(truth) - 1), 0.45}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

/// A bush of leaves, each a small card of two sides, above a ground.
Outcome foliage(const Lab& lab) {
  Mesh mesh = empty_mesh();
  mesh.materials[0].albedo = glm::vec3(0.5F);
  add_quad(mesh, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0});
  mesh.materials.push_back(mesh.materials[0]);
  mesh.materials[1].double_sided = true;
  Random random(30);
  for (int i = 0; i < 6000; ++i) {
    const glm::mat3 turned = random.rotation();
    const glm::vec3 at = glm::vec3(0, 0, 1) + 0.7F * glm::vec3(random.in_box(-0.7, 0.7));
    add_quad(mesh, at, turned[0] * 0.04F, turned[1] * 0.04F, 1);
  }
  LightRig lights;
  lights.sky.radiance = glm::vec3(1);
  const SmallScene scene(lab, mesh, lights, 40'000);
  const double lift = 0.15 * scene.radius();
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [&](double u, double v) {
        return Receiver{{2.4 * u - 1.2, 2.4 * v - 1.2, lift}, {0, 0, 1}};
      });
  const auto shaded = scene.shade(receivers, white_sky);
  const auto traced = trace_at_mesh(lab, mesh, lights, receivers, 1024);
  const auto ours = values(shaded, brightness), truth = values(traced, brightness);
  const auto open = values(shaded, openness), truly_open = values(traced, openness);
  return {.figures = {{"occlusion, mean error", std::abs(mean_value(open) - mean_value(truly_open)),
                       0.015},
                      {"light, RMS error over its mean", relative_rms(ours, truth), 0.02}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

constexpr std::array kWallRows = std::to_array<Row>({
    {"7", "closed ball from within", "gaps between discs", closed_ball},
    {"11", "bright sheet of one side from behind", "light through the back", behind_a_sheet},
    {"11", "walls of two sides, turned", "the light of one side on the other", two_sides},
    {"23", "closed boxes under sun and sky, walls of 0 to 10 spacings", "light within", coffin},
    {"30", "walls 10 to 0.1 radii thick", "the light of one side on the other", thin_walls},
    {"31", "room lit by a slit", "light that is lost, or blotches", slit},
    {"32", "bush of leaf cards", "too dark below it", foliage},
});

}  // namespace

std::span<const Row> rows_of_walls() {
  return kWallRows;
}

}  // namespace ptc::bench
