// Places receivers on the Z-curve, and bounds the receivers of a cell.
#include "engine/shade/gather/receiver_cell.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>

#include "engine/shade/scene_scale.h"

namespace ptc {

MortonKey receiver_key(const Frame& frame, const glm::dvec3& position, unsigned variant) {
  LatticePoint q = frame.to_lattice({position.x, position.y, position.z});
  if (variant == 0) return encode_morton(q);
  // Put the scene into half of the lattice, moved by up to the other half. The shifts of successive
  // variants spread evenly over the cube: multiples, modulo 1, of the powers -1, -2 and -3 of the
  // root of x^4 = x + 1 (Roberts 2018).
  constexpr std::array<double, 3> kStep{0.8191725134, 0.6710436067, 0.5497004779};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double whole = 0;
    const double shift = std::modf(kStep[axis] * variant, &whole);
    q[axis] = q[axis] / 2 + static_cast<std::uint64_t>(shift * 0x1p41);
  }
  return encode_morton(q);
}

ReceiverCell::ReceiverCell(std::span<const PlacedReceiver> receivers) {
  if (receivers.size() == 1) {
    centre = receivers[0].position;
    axis = receivers[0].normal;
    cone_cos = 1;
    has_horizon = true;
    return;
  }
  // Find the mean position and normal. Positions are summed relative to the first one, so that
  // scenes far from the origin lose nothing.
  glm::vec3 normals(0);
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
  // Bound the sphere, the cone and the depth.
  double farthest = 0;
  double lowest = 0;
  for (const PlacedReceiver& r : receivers) {
    const glm::dvec3 d = r.position - centre;
    farthest = std::max(farthest, glm::dot(d, d));
    cone_cos = std::min(cone_cos, glm::dot(axis, r.normal));
    lowest = std::min(lowest, glm::dot(d, glm::dvec3(r.normal)));
  }
  radius = static_cast<float>(std::sqrt(farthest) * SceneScale::kLatticeUnit);
  depth = static_cast<float>(-lowest * SceneScale::kLatticeUnit);
  cone_cos = std::max(cone_cos, -1.0F);
  cone_sin = std::sqrt(std::max(0.0F, 1 - cone_cos * cone_cos));
  has_horizon = cone_cos > 0.1F;
}

}  // namespace ptc
