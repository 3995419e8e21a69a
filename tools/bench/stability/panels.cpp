#include "tools/bench/stability/panels.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "tools/bench/stability/form_factors.h"

namespace ptc::bench {
namespace {

using Corners = std::vector<glm::dvec3>;

/// The points p with across . p > from.
struct HalfSpace {
  glm::dvec3 across;
  double from;

  [[nodiscard]] double above(const glm::dvec3& p) const { return glm::dot(across, p) - from; }
};

/// Returns the part of a convex polygon on one side of a plane. @param sign  1: above it, -1: below
Corners cut(const Corners& corners, const HalfSpace& space, double sign) {
  Corners kept;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const glm::dvec3 &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const double up_a = sign * space.above(a), up_b = sign * space.above(b);
    if (up_a >= 0) kept.push_back(a);
    if ((up_a < 0) != (up_b < 0)) kept.push_back(a + (b - a) * (up_a / (up_a - up_b)));
  }
  return kept;
}

/// Returns the front's normal of a panel, of any length.
glm::dvec3 front_of(const Panel& panel) {
  return glm::cross(panel.corners[1] - panel.corners[0], panel.corners[2] - panel.corners[0]);
}

/// Says whether a place sees the front of a panel, and not along its plane.
bool sees(const glm::dvec3& place, const Panel& panel) {
  const glm::dvec3 front = front_of(panel);
  return glm::dot(front, place - panel.corners[0]) > 1e-9 * glm::length(front);
}

/// Says whether a receiver sees the front of a panel, or some of it, over its horizon.
bool counts(const Receiver& receiver, const Panel& panel) {
  const glm::dvec3 normal(receiver.normal);
  return sees(receiver.position, panel) && std::ranges::any_of(panel.corners, [&](const auto& p) {
           return glm::dot(normal, p - receiver.position) > 1e-9;
         });
}

/// Returns the half-spaces whose intersection a panel hides from a place that sees its front.
std::vector<HalfSpace> hidden_by(const Panel& panel, const glm::dvec3& place) {
  std::vector<HalfSpace> spaces;
  for (std::size_t i = 0; i < panel.corners.size(); ++i) {
    const glm::dvec3 a = panel.corners[i] - place;
    const glm::dvec3 b = panel.corners[(i + 1) % panel.corners.size()] - place;
    const glm::dvec3 inwards = glm::cross(b, a);
    spaces.push_back({inwards, glm::dot(inwards, place)});
  }
  const glm::dvec3 behind = -front_of(panel);
  spaces.push_back({behind, glm::dot(behind, panel.corners[0])});
  return spaces;
}

/// Says whether a convex polygon lies outside of what some half-spaces have in common, as one of
/// them shows alone.
bool lies_outside(const Corners& piece, const std::vector<HalfSpace>& spaces) {
  return std::ranges::any_of(spaces, [&](const HalfSpace& space) {
    return std::ranges::all_of(piece, [&](const auto& p) { return space.above(p) <= 0; });
  });
}

/// Takes what several half-spaces have in common out of convex pieces.
void take_out(std::vector<Corners>& pieces, const std::vector<HalfSpace>& hidden) {
  std::vector<Corners> cut_off;
  for (Corners& piece : pieces) {
    if (lies_outside(piece, hidden)) continue;
    for (const HalfSpace& space : hidden) {
      cut_off.push_back(cut(piece, space, -1));
      piece = cut(piece, space, 1);
      if (piece.size() < 3) break;
    }
    piece.clear();
  }
  pieces.insert(pieces.end(), cut_off.begin(), cut_off.end());
  std::erase_if(pieces, [](const Corners& piece) { return piece.size() < 3; });
}

}  // namespace

Panel panel(const glm::dvec3& corner, const glm::dvec3& u, const glm::dvec3& v,
            const glm::vec3& radiance) {
  return {.corners = {corner, corner + u, corner + u + v, corner + v}, .radiance = radiance};
}

void add_block(std::vector<Panel>& panels, const glm::dvec3& low, const glm::dvec3& high,
               const glm::vec3& radiance) {
  const glm::dvec3 x(high.x - low.x, 0, 0), y(0, high.y - low.y, 0), z(0, 0, high.z - low.z);
  panels.push_back(panel(low + z, x, y, radiance));
  panels.push_back(panel(low, x, z, radiance));
  panels.push_back(panel(low + x, y, z, radiance));
  panels.push_back(panel(low + x + y, -x, z, radiance));
  panels.push_back(panel(low + y, -y, z, radiance));
}

Shading light_of_panels(const Receiver& receiver, std::span<const Panel> panels,
                        const glm::vec3& sky) {
  // Find what may be seen, and what it hides
  std::vector<const Panel*> seen;
  std::vector<std::vector<HalfSpace>> hidden;
  for (const Panel& panel : panels) {
    if (!counts(receiver, panel)) continue;
    seen.push_back(&panel);
    hidden.push_back(hidden_by(panel, receiver.position));
  }
  // Add what is left of each
  Shading light;
  double covered = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    std::vector<Corners> pieces{seen[i]->corners};
    for (std::size_t k = 0; k < seen.size(); ++k) {
      if (k != i) take_out(pieces, hidden[k]);
    }
    double share = 0;
    for (const Corners& piece : pieces) share += form_factor(receiver, piece);
    covered += share;
    light.irradiance += seen[i]->radiance * (kPi * static_cast<float>(share));
  }
  light.occlusion = static_cast<float>(covered);
  light.sky = sky * (kPi * static_cast<float>(1 - covered));
  return light;
}

double distance_to_walls(const Receiver& receiver, std::span<const Panel> panels) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Panel& panel : panels) {
    if (!counts(receiver, panel)) continue;
    const glm::dvec3 &corner = panel.corners[0], u = panel.corners[1] - corner,
                     v = panel.corners[3] - corner, to = receiver.position - corner;
    const double a = std::clamp(glm::dot(to, u) / glm::dot(u, u), 0.0, 1.0);
    const double b = std::clamp(glm::dot(to, v) / glm::dot(v, v), 0.0, 1.0);
    nearest = std::min(nearest, glm::length(to - a * u - b * v));
  }
  return nearest;
}

}  // namespace ptc::bench
