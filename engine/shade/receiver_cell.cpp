#include "engine/shade/receiver_cell.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace ptc {

ReceiverCell::ReceiverCell(std::span<const PlacedReceiver> receivers, double unit) {
  if (receivers.size() == 1) {
    centre = receivers[0].position;
    axis = receivers[0].normal;
    cone_cos = 1;
    has_horizon = true;
    return;
  }
  glm::vec3 normals(0);
  // Sums relative to the first, so that far-off scenes lose nothing.
  const glm::dvec3 origin = receivers[0].position;
  glm::dvec3 offsets(0);
  for (const PlacedReceiver& r : receivers) {
    offsets += r.position - origin;
    normals += r.normal;
  }
  centre = origin + offsets / static_cast<double>(receivers.size());
  const float length = std::sqrt(glm::dot(normals, normals));
  axis = length > 0 ? normals / length : glm::vec3(0, 0, 1);
  cone_cos = length > 0 ? 1.0F : -1.0F;
  double farthest = 0;
  double lowest = 0;
  for (const PlacedReceiver& r : receivers) {
    const glm::dvec3 d = r.position - centre;
    farthest = std::max(farthest, glm::dot(d, d));
    cone_cos = std::min(cone_cos, glm::dot(axis, r.normal));
    lowest = std::min(lowest, glm::dot(d, glm::dvec3(r.normal)));
  }
  radius = static_cast<float>(std::sqrt(farthest) * unit);
  depth = static_cast<float>(-lowest * unit);
  cone_cos = std::max(cone_cos, -1.0F);
  cone_sin = std::sqrt(std::max(0.0F, 1 - cone_cos * cone_cos));
  has_horizon = cone_cos > 0.1F;
}

}  // namespace ptc
