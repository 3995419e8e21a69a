// The light of panels beside rays that are traced in another way, and beside formulas.
#include "tools/bench/stability/panels.h"

#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/base/numbers.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

/// Averages what rays of equal weight see: the nearest front of a panel, or the sky.
glm::vec3 by_rays(const Receiver& receiver, const std::vector<Panel>& panels, const glm::vec3& sky,
                  unsigned rays) {
  const Basis basis(receiver.normal);
  glm::vec3 sum(0);
  for (unsigned k = 0; k < rays; ++k) {
    const double u = (k + 0.5) / rays, turn = 2.399963229728653 * k;
    const glm::dvec3 d(basis.to_world(
        {std::sqrt(u) * std::cos(turn), std::sqrt(u) * std::sin(turn), std::sqrt(1 - u)}));
    double nearest = std::numeric_limits<double>::infinity();
    glm::vec3 seen = sky;
    for (const Panel& panel : panels) {
      const glm::dvec3 corner = panel.corners[0], along = panel.corners[1] - corner,
                       across = panel.corners[3] - corner, front = glm::cross(along, across);
      const double facing = glm::dot(d, front);
      if (facing >= 0) continue;
      const double t = glm::dot(corner - receiver.position, front) / facing;
      const glm::dvec3 at = receiver.position + t * d - corner;
      const double a = glm::dot(at, along) / glm::dot(along, along),
                   b = glm::dot(at, across) / glm::dot(across, across);
      if (t <= 1e-9 || t >= nearest || a < 0 || a > 1 || b < 0 || b > 1) continue;
      nearest = t;
      seen = panel.radiance;
    }
    sum += seen;
  }
  return sum / static_cast<float>(rays);
}

}  // namespace

TEST_CASE("panels: what is clipped is what rays see", "[stability]") {
  // A floor, a wall, a block behind a pole, and a plate that floats across both
  std::vector<Panel> panels{panel({-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, {0.5F, 0, 0}),
                            panel({-2, 1.5, 0}, {4, 0, 0}, {0, 0, 2}, {0, 0.8F, 0})};
  add_block(panels, {-0.5, 0.4, 0}, {0.5, 1, 0.6}, {0, 0, 1});
  add_block(panels, {-0.1, 0, 0}, {0.1, 0.2, 0.9}, {1, 1, 0});
  add_block(panels, {-0.4, -0.1, 0.4}, {0.3, 0.7, 0.5}, {0, 1, 1});
  panels.push_back(panel({-0.4, -0.1, 0.4}, {0, 0.8, 0}, {0.7, 0, 0}, {0, 1, 1}));
  const glm::vec3 sky(0.2F, 0.1F, 0.3F);
  constexpr float kTop = 0.5773503F;
  for (const Receiver& receiver :
       {Receiver{{0.02, -0.03, 0}, {0, 0, 1}}, Receiver{{-0.7, 0.3, 0}, {0, 0, 1}},
        Receiver{{0.3, 1.5, 0.7}, {0, -1, 0}}, Receiver{{0.05, 0.4, 0.3}, {0, -1, 0}},
        Receiver{{0.6, -0.8, 0.7}, {-kTop, kTop, kTop}}}) {
    CAPTURE(receiver.position.x, receiver.position.y, receiver.position.z);
    const Shading light = light_of_panels(receiver, panels, sky);
    const glm::vec3 clipped = (light.irradiance + light.sky) / kPi;
    const glm::vec3 traced = by_rays(receiver, panels, sky, 1 << 17);
    for (int c = 0; c < 3; ++c) CHECK(clipped[c] == Approx(traced[c]).margin(1e-3));
    CHECK(light.sky.r == Approx(kPi * sky.r * (1 - light.occlusion)).margin(1e-6));
  }
}

TEST_CASE("panels: within a closed box no sky is seen", "[stability]") {
  std::vector<Panel> box{panel({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, glm::vec3(1)),
                         panel({0, 0, 1}, {0, 1, 0}, {1, 0, 0}, glm::vec3(1)),
                         panel({0, 0, 0}, {0, 1, 0}, {0, 0, 1}, glm::vec3(1)),
                         panel({1, 0, 0}, {0, 0, 1}, {0, 1, 0}, glm::vec3(1)),
                         panel({0, 0, 0}, {0, 0, 1}, {1, 0, 0}, glm::vec3(1)),
                         panel({0, 1, 0}, {1, 0, 0}, {0, 0, 1}, glm::vec3(1))};
  add_block(box, {0.3, 0.4, 0}, {0.6, 0.7, 0.5}, glm::vec3(1));
  for (const glm::dvec3& place : {glm::dvec3(0.1, 0.2, 0), glm::dvec3(0.301, 0.399, 0)})
    CHECK(light_of_panels({place, {0, 0, 1}}, box, {}).occlusion == Approx(1).margin(1e-6));
}

TEST_CASE("panels: walls are as far as what rises over the receiver", "[stability]") {
  std::vector<Panel> panels{panel({-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, {})};
  const Receiver on_floor{{0.1, 0.2, 0}, {0, 0, 1}};
  CHECK(std::isinf(distance_to_walls(on_floor, panels)));
  add_block(panels, {0.4, -1, 0}, {1, 1, 0.5}, {});
  CHECK(distance_to_walls(on_floor, panels) == Approx(0.3));
  // On its top, beside a side that lies below
  CHECK(std::isinf(distance_to_walls({{0.41, 0, 0.5}, {0, 0, 1}}, panels)));
  CHECK(distance_to_walls({{0.4, 0, 0.2}, {-1, 0, 0}}, panels) == Approx(0.2));
}
