// A set of receivers seen as one: what the gather tests clusters against.
#pragma once

#include <span>

#include <glm/vec3.hpp>

#include "format/morton.h"

namespace ptc {

/// A receiver in lattice units, with its place on the Z-curve.
struct PlacedReceiver {
  MortonKey key;
  glm::dvec3 position{0};  ///< lattice units
  glm::vec3 normal{0};
  std::size_t index = 0;  ///< in the caller's order
};

/// A receiver's place on the Z-curve. The cells of other variants have their borders elsewhere.
[[nodiscard]] MortonKey receiver_key(const Frame& frame, const glm::dvec3& position,
                                     unsigned variant);

/// Bounds of some receivers: positions in a sphere, normals in a cone.
struct ReceiverCell {
  glm::dvec3 centre{0};  ///< lattice units
  float radius = 0;      ///< in units of `unit`
  float depth = 0;    ///< farthest that a receiver lies below the centre along its normal, likewise
  glm::vec3 axis{0};  ///< unit
  float cone_cos = -1;  ///< every normal n: n . axis >= cone_cos
  float cone_sin = 0;
  bool has_horizon = false;  ///< the cone is narrow enough to cull below it

  /// @param unit  lattice unit, in what lengths are wanted in
  ReceiverCell(std::span<const PlacedReceiver> receivers, double unit);
};

}  // namespace ptc
