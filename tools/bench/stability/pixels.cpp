// Rows of single discs, direction pixels and receiver cells.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "engine/base/basis.h"
#include "engine/base/numbers.h"
#include "engine/shade/reference/brute_force.h"
#include "tools/bench/shapes/meshes.h"
#include "tools/bench/shapes/random.h"
#include "tools/bench/shapes/surfels.h"
#include "tools/bench/stability/form_factors.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

/// Receivers on the floor of small_scene(). @param lift  above it
std::vector<Receiver> floor_receivers(unsigned side, double lift) {
  return receivers_on_grid(side, side, [&](double u, double v) {
    return Receiver{{3 * u - 1.5, 1.4 - 2.9 * v, lift}, {0, 0, 1}};
  });
}

Surfel disc_at(const glm::dvec3& position, const glm::vec3& normal, double radius) {
  return {.position = position,
          .normal = normal,
          .radius = static_cast<float>(radius),
          .radiance = glm::vec3(1)};
}

/// Planes of any tilt and scale see nothing of themselves.
Outcome lone_plane(const Lab& lab) {
  Outcome outcome{.field = {.width = kReceiversAlong}};
  for (const double scale : {1e-3, 1.0, 1e4}) {
    for (int turn = 0; turn < 4; ++turn) {
      const double a = 0.7 * turn;
      const glm::dvec3 u(std::cos(a), std::sin(a), 0.3 * turn),
          v = glm::cross(glm::dvec3(0.1, 0.2, 1), u);
      std::vector<Surfel> surfels;
      add_rectangle(surfels, {0, 0, 0}, u * scale, glm::normalize(v) * scale, 0.02 * scale,
                    glm::vec3(1));
      // At the rim, in corners and inside
      std::vector<Receiver> receivers;
      for (std::size_t i = 0; receivers.size() < std::size_t{4} * kReceiversAlong; i += 19) {
        const Surfel& s = surfels[i % surfels.size()];
        receivers.push_back({s.position + glm::dvec3(s.normal * (0.15F * s.radius)), s.normal});
      }
      outcome.field.add(SmallScene(lab, surfels).shade(receivers), openness);
    }
  }
  outcome.field.truth = grey(outcome.field.ours.size(), 1);
  outcome.figures = {{"occlusion, largest", outcome.field.largest_error(), 0.002}};
  return outcome;
}

/// Single discs anywhere around the receiver, many of them behind it and beside it.
Outcome random_discs(const Lab& lab) {
  Random random(4);
  Outcome outcome{.field = {.width = kReceiversAlong, .height = kReceiversAlong}};
  constexpr unsigned kRays = 1 << 14;
  for (unsigned i = 0; i < kReceiversAlong * kReceiversAlong; ++i) {
    const glm::vec3 normal = random.direction();
    glm::dvec3 to = glm::dvec3(random.direction()) * random.between(0.3, 3);
    if (glm::dot(to, glm::dvec3(normal)) > 0) to = -to;  // its front
    const std::array disc{disc_at(to, normal, 1)};
    const std::array receiver{Receiver{{0, 0, 0}, random.direction()}};
    static const DirectionGrid grid(GatherOptions().resolution, {});
    std::array<Shading, 1> drawn;
    shade_brute_force(disc, receiver, drawn, grid, Sides::both, lab.executor);
    outcome.field.ours.push_back(openness(drawn[0]));
    // Cosine rays at the disc itself
    const Basis basis(receiver[0].normal);
    unsigned hits = 0;
    for (unsigned k = 0; k < kRays; ++k) {
      const double u = (k + 0.5) / kRays, turn = 2.399963229728653 * k;
      const glm::vec3 d = basis.to_world(
          {std::sqrt(u) * std::cos(turn), std::sqrt(u) * std::sin(turn), std::sqrt(1 - u)});
      const double t =
          glm::dot(to, glm::dvec3(normal)) / glm::dot(glm::dvec3(d), glm::dvec3(normal));
      if (t > 0 && glm::length(t * glm::dvec3(d) - to) < 1) ++hits;
    }
    outcome.field.truth.emplace_back(1 - static_cast<double>(hits) / kRays);
  }
  outcome.figures = {{"occlusion, largest error", outcome.field.largest_error(), 0.01},
                     {"occlusion, RMS error", outcome.field.rms_error(), 0.002}};
  return outcome;
}

/// A scene turned in eight ways, seen by receivers that turn with it.
Outcome turned(const Lab& lab) {
  constexpr double kSpacing = 0.04;
  const std::vector<Surfel> upright = small_scene(kSpacing);
  const auto receivers = floor_receivers(kReceiversAlong, 0.1 * kSpacing);
  const SmallScene first(lab, upright);
  const auto traced = first.trace(receivers, 4096);
  const auto truth = values(traced, brightness);
  Outcome outcome{.field = {kReceiversAlong, kReceiversAlong, {}, truth}};
  Random random(5);
  double worst = 0, square = 0;
  constexpr int kTurns = 8;
  for (int i = 0; i < kTurns; ++i) {
    const glm::dmat3 turn(random.rotation());
    std::vector<Surfel> surfels = upright;
    for (Surfel& s : surfels) {
      s.position = turn * s.position;
      s.normal = glm::vec3(turn * glm::dvec3(s.normal));
    }
    std::vector<Receiver> places = receivers;
    for (Receiver& r : places) {
      r.position = turn * r.position;
      r.normal = glm::vec3(turn * glm::dvec3(r.normal));
    }
    const auto shaded = SmallScene(lab, surfels).shade(places);
    outcome.field.ours = values(shaded, brightness);
    const double rms = relative_rms(outcome.field.ours, truth);
    worst = std::max(worst, rms);
    square += std::pow(rms_difference(values(shaded, openness), values(traced, openness)), 2);
  }
  outcome.figures = {{"occlusion, RMS error over all turns", std::sqrt(square / kTurns), 0.02},
                     {"light, RMS error over its mean, worst turn", worst, 0.06}};
  return outcome;
}

/// A cube that stands on its edge.
Outcome edge_on(const Lab& lab) {
  constexpr double kSpacing = 0.02, kHalf = 0.5;
  // Its faces, turned by 45 degrees about y, in the height 1
  const double s = std::sqrt(0.5);
  const glm::dmat3 turn(s, 0, s, 0, 1, 0, -s, 0, s);
  const glm::dvec3 middle(0, 0, 1);
  std::vector<Surfel> surfels;
  std::vector<std::array<glm::dvec3, 4>> faces;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      glm::dvec3 n(0), u(0), v(0);
      n[axis] = sign * kHalf;
      u[(axis + 1) % 3] = sign * 2 * kHalf;
      v[(axis + 2) % 3] = 2 * kHalf;
      const glm::dvec3 corner = middle + turn * (n - 0.5 * (u + v));
      u = turn * u;
      v = turn * v;
      add_rectangle(surfels, corner, u, v, kSpacing, glm::vec3(1));
      faces.push_back({corner, corner + u, corner + u + v, corner + v});
    }
  }
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [](double u, double v) {
        return Receiver{{4 * u - 2, 4 * v - 2, -0.1}, {0, 0, 1}};
      });
  std::vector<glm::vec3> truth;
  for (const Receiver& receiver : receivers) {
    double covered = 0;
    for (const auto& face : faces) covered += form_factor(receiver, face);
    truth.emplace_back(1 - covered);
  }
  const auto ours = values(SmallScene(lab, surfels).shade(receivers), openness);
  return {
      .figures = {{"occlusion, largest error", largest_difference(ours, truth), 0.02},
                  {"occlusion, mean error", std::abs(mean_value(ours) - mean_value(truth)), 0.004}},
      .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

/// The gather without clusters, beside all surfels drawn one by one.
Outcome nothing_culled(const Lab& lab) {
  const SmallScene scene(lab, small_scene(0.1));
  const auto receivers = floor_receivers(kReceiversAlong, 0.01);
  GatherOptions exact{.solid_angle = 1e-12F, .parallax = 1e-6F};
  const auto shaded = scene.shade(receivers, {}, exact);
  std::vector<Shading> all(receivers.size());
  const DirectionGrid grid(exact.resolution, {});
  shade_brute_force(scene.surfels(), receivers, all, grid, Sides::both, lab.executor);
  const auto ours = values(shaded, brightness), truth = values(all, brightness);
  // Rounding at the edges of discs moves single pixels
  return {.figures = {{"light, RMS difference", rms_difference(ours, truth), 1e-3}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

/// Receivers within a shell of few large discs, whose clusters have boxes around them.
Outcome shell(const Lab& lab) {
  std::vector<Surfel> surfels;
  add_sphere(surfels, {0, 0, 0}, 1, 0.2, glm::vec3(1));
  for (Surfel& surfel : surfels) {
    surfel.normal = -surfel.normal;
    surfel.radius *= 1.3F;  // no gaps between discs
  }
  const SmallScene scene(lab, surfels);
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [](double u, double v) {
        const glm::vec3 normal(std::cos(20 * u), std::sin(20 * u) * 0.6F, std::sin(20 * u) * 0.8F);
        return Receiver{{1.2 * u - 0.6, 1.2 * v - 0.6, 0.1}, glm::normalize(normal)};
      });
  const auto ours = values(scene.shade(receivers), brightness);
  const auto truth = grey(ours.size(), 1);
  return {.figures = {{"light, largest error", largest_difference(ours, truth), 0.03},
                      {"light, RMS error", rms_difference(ours, truth), 0.01}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

/// One small disc in each of a thousand directions.
Outcome thousand_directions(const Lab& lab) {
  constexpr double kSolidAngle = 0.02;
  Random random(12);
  Outcome outcome{.field = {.width = kReceiversAlong, .height = kReceiversAlong}};
  const DirectionGrid grid(GatherOptions().resolution, {});
  double sum = 0;
  for (unsigned i = 0; i < kReceiversAlong * kReceiversAlong; ++i) {
    const glm::vec3 direction = random.direction();
    const double distance = std::exp(6 * random.unit() - 3);
    const std::array disc{disc_at(glm::dvec3(direction) * distance, -direction,
                                  std::sqrt(kSolidAngle / kPiDouble) * distance)};
    const std::array receiver{Receiver{{0, 0, 0}, direction}};
    std::array<Shading, 1> drawn;
    shade_brute_force(disc, receiver, drawn, grid, Sides::both, lab.executor);
    const double ratio = double{drawn[0].occlusion} * kPiDouble / kSolidAngle;
    sum += ratio;
    outcome.field.ours.emplace_back(0.5 * ratio);
  }
  outcome.field.truth = grey(outcome.field.ours.size(), 0.5);
  outcome.figures = {
      {"solid angle, mean error", std::abs(sum / (kReceiversAlong * kReceiversAlong) - 1), 0.02},
      {"solid angle, RMS error", 2 * outcome.field.rms_error(), 0.15}};
  return outcome;
}

/// An emitter that moves by small steps from `first` to `last`, radians from the normal.
Outcome moving_emitter(const Lab& lab, double first, double last, double radius) {
  constexpr unsigned kSteps = 256, kRays = 1 << 14, kRows = 24, kShown = 4;  // steps of a column
  const DirectionGrid grid(GatherOptions().resolution, {});
  const std::array receiver{Receiver{{0, 0, 0}, {0, 0, 1}}};
  std::vector<glm::vec3> ours, truth;
  for (unsigned i = 0; i < kSteps; ++i) {
    const double angle = first + (last - first) * i / (kSteps - 1);
    const glm::dvec3 to(std::sin(angle), 0, std::cos(angle));
    const std::array disc{disc_at(to, glm::vec3(-to), radius)};
    std::array<Shading, 1> drawn;
    shade_brute_force(disc, receiver, drawn, grid, Sides::both, lab.executor);
    // The disc by points of equal area
    double light = 0;
    for (unsigned k = 0; k < kRays; ++k) {
      const double r = radius * std::sqrt((k + 0.5) / kRays), turn = 2.399963229728653 * k;
      const glm::dvec3 at = to +
                            r * std::cos(turn) * glm::dvec3(std::cos(angle), 0, -std::sin(angle)) +
                            glm::dvec3(0, r * std::sin(turn), 0);
      const double distance = glm::length(at);
      light += std::max(0.0, at.z) * glm::dot(at, to) / std::pow(distance, 4);
    }
    ours.push_back(brightness(drawn[0]));
    truth.emplace_back(light * radius * radius / kRays);
  }
  const double white = std::max(
      1e-9, static_cast<double>(
                std::ranges::max_element(truth, {}, [](const glm::vec3& v) { return v.r; })->r));
  double step = 0, true_step = 0;
  for (std::size_t i = 1; i < ours.size(); ++i) {
    step = std::max(step, std::abs(static_cast<double>(ours[i].r - ours[i - 1].r)) / white);
    true_step =
        std::max(true_step, std::abs(static_cast<double>(truth[i].r - truth[i - 1].r)) / white);
  }
  Outcome outcome{.figures = {{"largest step beyond the true one", step - true_step, 0.05},
                              {"largest error over the greatest light",
                               largest_difference(ours, truth) / white, 0.1}},
                  .field = {.width = kSteps / kShown, .height = kRows}};
  for (unsigned row = 0; row < kRows; ++row) {
    for (unsigned i = 0; i < kSteps; i += kShown) {
      outcome.field.ours.push_back(ours[i] / static_cast<float>(white));
      outcome.field.truth.push_back(truth[i] / static_cast<float>(white));
    }
  }
  return outcome;
}

Outcome across_pixels(const Lab& lab) {
  return moving_emitter(lab, 0.5, 0.8, 0.2);
}

Outcome across_horizon(const Lab& lab) {
  return moving_emitter(lab, 1.2, 1.8, 0.2);
}

/// Neighbouring receivers across the borders of cells: the error must not jump.
Outcome cell_seams(const Lab& lab) {
  constexpr double kSpacing = 0.05;
  constexpr unsigned kFine = 64;
  const SmallScene scene(lab, small_scene(kSpacing));
  // Close together, so that the truth hardly changes from one to the next
  const auto receivers = receivers_on_grid(kFine, kFine, [&](double u, double v) {
    return Receiver{{0.3 * u - 1.3, 0.3 * v - 0.4, 0.1 * kSpacing}, {0, 0, 1}};
  });
  const auto shaded = scene.shade(receivers);
  std::vector<Shading> all(receivers.size());
  const DirectionGrid grid(GatherOptions().resolution, {});
  shade_brute_force(scene.surfels(), receivers, all, grid, Sides::both, lab.executor);
  const auto ours = values(shaded, brightness), truth = values(all, brightness);
  double largest = 0;
  for (unsigned y = 0; y < kFine; ++y) {
    for (unsigned x = 0; x + 1 < kFine; ++x) {
      const std::size_t i = std::size_t{y} * kFine + x;
      for (int c = 0; c < 3; ++c) {
        const float step = (ours[i + 1][c] - truth[i + 1][c]) - (ours[i][c] - truth[i][c]);
        largest = std::max(largest, std::abs(static_cast<double>(step)));
      }
    }
  }
  return {.figures = {{"light, largest step of its error", largest, 0.02},
                      {"light, RMS error", rms_difference(ours, truth), 0.01}},
          .field = {kFine, kFine, ours, truth}};
}

/// Receivers whose normals lean up to 89.9 degrees from the plane that they lie on.
Outcome grazing(const Lab& lab) {
  constexpr double kSpacing = 0.1, kHalf = 20;
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-kHalf, -kHalf, 0}, {2 * kHalf, 0, 0}, {0, 2 * kHalf, 0}, kSpacing,
                glm::vec3(1));
  const SmallScene scene(lab, surfels);
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [&](double u, double v) {
        const double lean = 89.9 * kPiDouble / 180 * v, turn = 2 * kPiDouble * u;
        const glm::dvec3 normal(std::sin(lean) * std::cos(turn), std::sin(lean) * std::sin(turn),
                                std::cos(lean));
        return Receiver{{3.17 * u, 2.23 * v, 0.1 * kSpacing}, glm::vec3(normal)};
      });
  // The plane covers all below its horizon, but for what lies beyond its edge
  const std::array<glm::dvec3, 4> plane{
      {{-kHalf, -kHalf, 0}, {kHalf, -kHalf, 0}, {kHalf, kHalf, 0}, {-kHalf, kHalf, 0}}};
  std::vector<glm::vec3> truth;
  for (const Receiver& receiver : receivers) truth.emplace_back(form_factor(receiver, plane));
  const auto ours = values(scene.shade(receivers), brightness);
  return {.figures = {{"light of the plane, largest error", largest_difference(ours, truth), 0.02},
                      {"light of the plane, RMS error", rms_difference(ours, truth), 0.01}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

constexpr std::array kPixelRows = std::to_array<Row>({
    {"3", "lone planes of any tilt and scale", "surfaces that shade themselves", lone_plane},
    {"4", "single discs all around a receiver", "dark blotches of discs behind it", random_discs},
    {"5", "scene turned in eight ways", "light that depends on the turn", turned},
    {"6", "cube that stands on its edge", "coverage that counts twice", edge_on},
    {"9", "gather without clusters", "surfels that are left out", nothing_culled},
    {"10", "receivers within a shell of few discs", "clusters around the receiver", shell},
    {"12", "small disc in a thousand directions", "solid angles too small off axis",
     thousand_directions},
    {"13", "emitter that moves across pixels", "light that jumps", across_pixels},
    {"14", "emitter that sets behind the horizon", "light that jumps", across_horizon},
    {"28", "normals that lean up to 89.9 degrees", "the plane below is lost", grazing},
    {"29", "neighbours across the borders of cells", "seams", cell_seams},
});

}  // namespace

std::span<const Row> rows_of_pixels() {
  return kPixelRows;
}

}  // namespace ptc::bench
