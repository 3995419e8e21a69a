// Rows in which surfaces meet, touch or overlap.
#include <array>
#include <cmath>
#include <numbers>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "tools/bench/shapes/meshes.h"
#include "tools/bench/shapes/surfels.h"
#include "tools/bench/stability/form_factors.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

constexpr unsigned kWidth = 48, kHeight = 48;

/// A floor of z = 0 beside a wall of x = 0 that shines.
Outcome crease(const Lab& lab) {
  constexpr double kSpacing = 0.02;
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, -3, 0}, {0, 6, 0}, {0, 0, 2}, kSpacing, glm::vec3(1));
  add_rectangle(surfels, {0, -3, 0}, {3, 0, 0}, {0, 6, 0}, kSpacing, glm::vec3(0));
  const SmallScene scene(lab, surfels);
  // Down to a quarter of a spacing from the wall
  const auto receivers = receivers_on_grid(kWidth, 24, [&](double u, double v) {
    return Receiver{{0.25 * kSpacing * std::pow(400, u), 4 * v - 2, 0.1 * kSpacing}, {0, 0, 1}};
  });
  const std::array<glm::dvec3, 4> wall{{{0, -3, 0}, {0, 3, 0}, {0, 3, 2}, {0, -3, 2}}};
  std::vector<glm::vec3> open, light;
  for (const Receiver& receiver : receivers) {
    const double covered = form_factor(receiver, wall);
    open.emplace_back(1 - covered);
    light.emplace_back(covered);
  }
  const auto shaded = scene.shade(receivers);
  const auto ours = values(shaded, brightness), ours_open = values(shaded, openness);
  double beside = 0, within = 0;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const double error = std::max(std::abs(static_cast<double>(ours[i].g - light[i].g)),
                                  std::abs(static_cast<double>(ours_open[i].g - open[i].g)));
    double& largest = receivers[i].position.x < kSpacing ? within : beside;
    largest = std::max(largest, error);
  }
  return {.figures = {{"light and occlusion, largest error", beside, 0.05},
                      {"the same within a spacing of the wall", within, 0.03}},
          .field = {kWidth, 24, ours, light}};
}

/// Two sheets that meet at angles from 20 to 150 degrees.
Outcome wedges(const Lab& lab) {
  constexpr double kSpacing = 0.02;
  constexpr unsigned kRows = 8;
  Outcome outcome{.field = {.width = kWidth}};
  for (const double degrees : {20.0, 45.0, 90.0, 150.0}) {
    const double angle = degrees * kPiDouble / 180;
    const glm::dvec3 along(0, 6, 0), up(2 * std::cos(angle), 0, 2 * std::sin(angle));
    std::vector<Surfel> surfels;
    add_rectangle(surfels, {0, -3, 0}, {2, 0, 0}, along, kSpacing, glm::vec3(0));
    add_rectangle(surfels, {0, -3, 0}, along, up, kSpacing, glm::vec3(1));
    const SmallScene scene(lab, surfels);
    const auto receivers = receivers_on_grid(kWidth, kRows, [&](double u, double v) {
      return Receiver{{0.5 * kSpacing * std::pow(100, u), 2 * v - 1, 0.1 * kSpacing}, {0, 0, 1}};
    });
    const std::array<glm::dvec3, 4> sheet{
        {{0, -3, 0}, {0, 3, 0}, glm::dvec3(0, 3, 0) + up, glm::dvec3(0, -3, 0) + up}};
    outcome.field.add(scene.shade(receivers), brightness);
    for (const Receiver& receiver : receivers)
      outcome.field.truth.emplace_back(form_factor(receiver, sheet));
  }
  outcome.figures = {{"light of the slope, largest error", outcome.field.largest_error(), 0.04},
                     {"light of the slope, RMS error", outcome.field.rms_error(), 0.01}};
  return outcome;
}

/// Closed wedges under a bright sky: nothing of it may arrive.
Outcome closed_wedges(const Lab& lab) {
  constexpr unsigned kRows = 16;
  Outcome outcome{.field = {.width = kWidth}};
  std::vector<glm::vec3> discs;
  double wide = 0, narrow = 0;
  for (const float angle : {0.6F, 0.3F, 0.1F}) {
    Mesh mesh = empty_mesh();
    mesh.materials[0].albedo = glm::vec3(0);
    const glm::vec3 a(0, -1, 0), b(1, -1, 0), c(std::cos(angle), -1, std::sin(angle));
    const glm::vec3 along(0, 2, 0);
    add_quad(mesh, a, b - a, along);
    add_quad(mesh, a, along, c - a);
    add_quad(mesh, b, c - b, along);
    add_triangle(mesh, a, c, b);
    add_triangle(mesh, a + along, b + along, c + along);
    const SmallScene scene(lab, mesh, {}, 30'000);
    const auto receivers = receivers_on_grid(kWidth, kRows, [&](double u, double v) {
      return Receiver{{0.98 * std::pow(10, 2 * u - 2), 1.8 * v - 0.9, 1e-4}, {0, 0, 1}};
    });
    const double clear = 2 * scene.radius() / static_cast<double>(std::tan(angle));
    const auto shaded = scene.shade(receivers, white_sky);
    outcome.field.add(shaded, brightness);
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      const double leak = static_cast<double>(brightness(shaded[i]).g);
      double& largest = receivers[i].position.x < clear ? narrow : wide;
      largest = std::max(largest, leak);
    }
    for (const Shading& shading : scene.trace(receivers, 256, white_sky))
      discs.push_back(brightness(shading));
  }
  outcome.field.truth = grey(outcome.field.ours.size(), 0);
  outcome.figures = {
      {"sky that leaks in where 2 radii are between the sheets, largest", wide, 0.03},
      {"nearer to the crease, largest", narrow, 0.15},
      {"sky that leaks in, mean", mean_value(outcome.field.ours), 0.005},
      {"the same between the discs themselves, mean", mean_value(discs), 0.005}};
  return outcome;
}

/// A black wall closely before a bright one.
Outcome near_walls(const Lab& lab) {
  constexpr double kSpacing = 0.02;
  constexpr unsigned kRows = 12;
  Outcome outcome{.field = {.width = kWidth}};
  for (const double gap : {3.0, 1.0, 0.3, 0.1}) {
    std::vector<Surfel> surfels;
    add_rectangle(surfels, {-2, 2, 1}, {4, 0, 0}, {0, -4, 0}, kSpacing, glm::vec3(0));
    add_rectangle(surfels, {-2, 2, 1 + gap * kSpacing}, {4, 0, 0}, {0, -4, 0}, kSpacing * 1.1,
                  glm::vec3(1));
    const SmallScene scene(lab, surfels);
    const auto receivers = receivers_on_grid(kWidth, kRows, [&](double u, double v) {
      return Receiver{{2 * u - 1, v - 0.5, 0.9 * u}, {0, 0, 1}};
    });
    outcome.field.add(scene.shade(receivers), brightness);
  }
  outcome.field.truth = grey(outcome.field.ours.size(), 0);
  outcome.figures = {{"light of the hidden wall, largest", outcome.field.largest_error(), 0.5},
                     {"light of the hidden wall, mean", mean_value(outcome.field.ours), 0.25}};
  return outcome;
}

/// A plate above another: shadows do not add up.
Outcome stacked_plates(const Lab& lab) {
  constexpr double kSpacing = 0.02, kLow = 1, kHigh = 1.3, kLowHalf = 0.5, kHighHalf = 0.7;
  std::vector<Surfel> surfels;
  const auto plate = [&](double half, double height) {
    add_rectangle(surfels, {-half, half, height}, {2 * half, 0, 0}, {0, -2 * half, 0}, kSpacing,
                  glm::vec3(0));
  };
  plate(kLowHalf, kLow);
  plate(kHighHalf, kHigh);
  const SmallScene scene(lab, surfels);
  const auto receivers = receivers_on_grid(kWidth, kHeight, [](double u, double v) {
    return Receiver{{4 * u - 2, 4 * v - 2, 0}, {0, 0, 1}};
  });
  std::vector<glm::vec3> truth;
  for (const Receiver& receiver : receivers) {
    // What both cover is the part of the lower plate within the projection of the upper one
    const glm::dvec2 at(receiver.position);
    const auto covered = [&](const glm::dvec2& low, const glm::dvec2& high, double z) {
      if (low.x >= high.x || low.y >= high.y) return 0.0;
      const std::array<glm::dvec3, 4> corners{
          {{low.x, low.y, z}, {low.x, high.y, z}, {high.x, high.y, z}, {high.x, low.y, z}}};
      return form_factor(receiver, corners);
    };
    const glm::dvec2 low(kLowHalf), high(kHighHalf);
    const double scale = kLow / kHigh;
    const glm::dvec2 left = glm::max(-low, at + (-high - at) * scale);
    const glm::dvec2 right = glm::min(low, at + (high - at) * scale);
    truth.emplace_back(1 - covered(-low, low, kLow) - covered(-high, high, kHigh) +
                       covered(left, right, kLow));
  }
  const auto ours = values(scene.shade(receivers), openness);
  return {.figures = {{"occlusion, largest error", largest_difference(ours, truth), 0.03},
                      {"occlusion, RMS error", rms_difference(ours, truth), 0.005}},
          .field = {kWidth, kHeight, ours, truth}};
}

/// A disc that shines, from 2 radii down to contact.
Outcome contact(const Lab& lab) {
  std::vector<Surfel> surfels{{.position = {0, 0, 0},
                               .normal = {0, 0, -1},
                               .radius = 1,
                               .radiance = glm::vec3(0.4F),
                               .emission = glm::vec3(0.6F)}};
  const SmallScene scene(lab, surfels);
  constexpr std::array kHeights{2.0, 1.0, 0.3, 1e-1, 1e-2, 1e-3, 1e-6, 1e-7};
  const auto receivers = receivers_on_grid(kWidth, kHeights.size(), [&](double u, double v) {
    const auto row = static_cast<std::size_t>(v * static_cast<double>(kHeights.size()));
    return Receiver{{1.8 * u, 0, -kHeights[row]}, {0, 0, 1}};
  });
  std::vector<glm::vec3> truth;
  for (const Receiver& receiver : receivers)
    truth.emplace_back(disc_form_factor(-receiver.position.z, receiver.position.x, 1));
  const auto shaded = scene.shade(receivers);
  const auto ours = values(shaded, brightness);
  double most = 0;
  for (const Shading& shading : shaded) most = std::max(most, double{shading.occlusion});
  return {.figures = {{"light of the disc, largest error", largest_difference(ours, truth), 0.03},
                      {"light of the disc, RMS error", rms_difference(ours, truth), 0.006},
                      {"covered beyond the hemisphere", std::max(0.0, most - 1), 1e-5}},
          .field = {kWidth, kHeights.size(), ours, truth}};
}

/// A ball sunk into a floor: surfels in it are buried, and the ring of contact is sharp.
Outcome sunk_ball(const Lab& lab) {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {-3, -3, 0}, {6, 0, 0}, {0, 6, 0});
  Mesh ball = sphere(1, 24);
  for (glm::vec3& p : ball.positions) p = {p.x, -p.z, p.y + 0.5F};
  for (const auto& t : ball.triangles)
    add_triangle(mesh, ball.positions[t[0]], ball.positions[t[1]], ball.positions[t[2]]);
  LightRig lights;
  lights.sky.radiance = glm::vec3(1);
  const SmallScene scene(lab, mesh, lights, 20'000);
  const double lift = 0.15 * scene.radius();
  // Around the ball, from the ring of contact outwards
  constexpr unsigned kTurns = 24;
  const auto receivers = receivers_on_grid(kWidth, kTurns, [&](double u, double v) {
    const double ring = std::sqrt(0.75) + 0.01 + 1.5 * u * u, turn = 2 * kPiDouble * v;
    return Receiver{{ring * std::cos(turn), ring * std::sin(turn), lift}, {0, 0, 1}};
  });
  const auto shaded = scene.shade(receivers, white_sky);
  const auto traced = trace_at_mesh(lab, mesh, lights, receivers, 1024);
  const auto ours = values(shaded, brightness), truth = values(traced, brightness);
  return {.figures = {{"occlusion, RMS error",
                       rms_difference(values(shaded, openness), values(traced, openness)), 0.02},
                      {"light, RMS error over its mean", relative_rms(ours, truth), 0.03}},
          .field = {kWidth, kTurns, ours, truth}};
}

/// A ball of tiny discs on a floor of discs that are larger than the ball.
Outcome huge_beside_tiny(const Lab& lab) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-40, -40, 0}, {80, 0, 0}, {0, 80, 0}, 8, glm::vec3(0.3F));
  add_sphere(surfels, {0.3, 0.2, 0.5}, 0.5, 0.02, {1, 0.5F, 0.2F});
  const SmallScene scene(lab, surfels);
  const auto receivers = receivers_on_grid(kWidth, kHeight, [](double u, double v) {
    return Receiver{{3 * u - 1.5, 3 * v - 1.5, 0.002}, {0, 0, 1}};
  });
  const auto shaded = scene.shade(receivers), traced = scene.trace(receivers, 4096);
  const auto ours = values(shaded, brightness), truth = values(traced, brightness);
  return {.figures = {{"occlusion, RMS error",
                       rms_difference(values(shaded, openness), values(traced, openness)), 0.01},
                      {"light, RMS error", rms_difference(ours, truth), 0.01}},
          .field = {kWidth, kHeight, ours, truth}};
}

/// A red and a green sheet in one plane: whichever is seen, as much light comes.
Outcome coplanar(const Lab& lab) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-1, 1, 1}, {2, 0, 0}, {0, -2, 0}, 0.02, {1, 0, 0});
  add_rectangle(surfels, {-1, 1, 1}, {2, 0, 0}, {0, -2, 0}, 0.023, {0, 1, 0});
  const SmallScene scene(lab, surfels);
  const auto receivers = receivers_on_grid(kWidth, kHeight, [](double u, double v) {
    return Receiver{{2 * u - 1, 2 * v - 1, 0}, {0, 0, 1}};
  });
  const std::array<glm::dvec3, 4> sheet{{{-1, -1, 1}, {-1, 1, 1}, {1, 1, 1}, {1, -1, 1}}};
  std::vector<glm::vec3> ours, truth;
  for (const Shading& shading : scene.shade(receivers)) {
    const glm::vec3 light = brightness(shading);
    ours.emplace_back(light.r + light.g);
  }
  for (const Receiver& receiver : receivers) truth.emplace_back(form_factor(receiver, sheet));
  return {
      .figures = {{"light of both sheets, largest error", largest_difference(ours, truth), 0.02},
                  {"light of both sheets, RMS error", rms_difference(ours, truth), 0.015}},
      .field = {kWidth, kHeight, ours, truth}};
}

constexpr std::array kContactRows = std::to_array<Row>({
    {"1", "floor beside a wall", "blotches at the crease", crease},
    {"1", "wedges of 20 to 150 degrees", "blotches at the crease", wedges},
    {"2", "closed wedges of 6 to 34 degrees under a sky", "light in the crease", closed_wedges},
    {"8", "black wall just before a white one", "the wall behind shines through", near_walls},
    {"16", "plate above a plate", "shadows that add up", stacked_plates},
    {"17", "disc from 2 radii down to contact", "far too much light", contact},
    {"25", "ball sunk into a floor", "light or dark at the contact", sunk_ball},
    {"26", "tiny discs on huge ones", "shadows that are lost or too large", huge_beside_tiny},
    {"27", "two sheets in one plane", "light that counts twice or not at all", coplanar},
});

}  // namespace

std::span<const Row> rows_of_contacts() {
  return kContactRows;
}

}  // namespace ptc::bench
