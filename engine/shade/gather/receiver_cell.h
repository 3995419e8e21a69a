// A set of neighbouring receivers as the gather sees it: one sphere of positions and one cone of
// normals.
#pragma once

#include <span>

#include <glm/vec3.hpp>

#include "format/morton.h"

namespace ptc {

/// A receiver in lattice units, with its place on the Z-curve.
struct PlacedReceiver {
  MortonKey key;           ///< receiver_key() of its position
  glm::dvec3 position{0};  ///< lattice units
  glm::vec3 normal{0};     ///< unit
  std::size_t index = 0;   ///< in the caller's order
};

/// Returns the place of a receiver on the Z-curve, by which receivers are sorted and divided into
/// cells.
/// @param position  scene units
/// @param variant   moves the borders of the cells, so that the errors of two variants are unlike
[[nodiscard]] MortonKey receiver_key(const Frame& frame, const glm::dvec3& position,
                                     unsigned variant);

/// Bounds of a set of receivers: positions in a sphere, normals in a cone.
///
///              axis
///          \    ^    /         The normals of all receivers o lie in the cone, their positions in
///         . \ - | - / .        the sphere around the centre x. `depth` is how far a receiver lies
///       /  o \  |  /    \      below x along its own normal, at most: a thing that is lower than
///      |      \ | /  o   |     that is under the horizon of every receiver.
///      |       \|/       |
///       \       x  o    /
///         ' - . _ . - '
struct ReceiverCell {
  glm::dvec3 centre{0};  ///< mean position, lattice units
  float radius = 0;      ///< of the sphere of positions, in the unit that the constructor was given
  float depth = 0;  ///< farthest that a receiver lies below the centre along its normal, same unit
  glm::vec3 axis{0};         ///< mean normal, unit
  float cone_cos = -1;       ///< cosine of the cone's half angle: n . axis >= cone_cos for each n
  float cone_sin = 0;        ///< sine of the cone's half angle
  bool has_horizon = false;  ///< whether the cone is narrow enough to cull what lies below it

  /// Bounds the receivers.
  /// @param receivers  at least one
  /// @param unit       the lattice unit, expressed in the unit that lengths are wanted in
  ReceiverCell(std::span<const PlacedReceiver> receivers);
};

}  // namespace ptc
