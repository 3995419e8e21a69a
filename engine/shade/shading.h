// What shading takes and gives (spec/shading.md).
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "format/morton.h"

namespace ptc {

/// A place to be shaded.
struct Receiver {
  glm::dvec3 position{0};  ///< scene units, already lifted off its surface
  glm::vec3 normal{0};     ///< unit
};

/// Light that arrives at a receiver.
struct Shading {
  float occlusion = 0;       ///< cosine-weighted share of the hemisphere that is covered, 0 to 1
  glm::vec3 bent_normal{0};  ///< unit mean of the uncovered directions; the normal when none is
  glm::vec3 irradiance{0};   ///< from surfaces, W / m^2
  glm::vec3 sky{0};          ///< from the environment where it is not covered, W / m^2
};

/// Which sides of a surfel stop light. Radiance always leaves the front alone.
enum class Sides {
  both,   ///< the back is black, and transparent to receivers within two radii of the centre
  front,  ///< right and faster where no back side is ever seen
};

struct GatherOptions {
  float solid_angle = 0.01F;  ///< a cluster is not opened when its bounding sphere is below it, sr
  float parallax = 0.1F;  ///< a cluster is shared by receivers that see it within this angle, rad
  float inflation =
      2;  ///< footprint of a cluster that is not flat over its projected area, at most
  unsigned resolution = 32;  ///< direction pixels along a cube edge, 16 to 64, a multiple of 16
  Sides sides = Sides::both;
  bool bleeding = true;  ///< false: light from surfaces is left out, which takes less time
};

// What a cluster is drawn as (spec/shading.md#splats).
inline constexpr float kFlat = 0.9F;  ///< length of the mean normal above which it is one surfel
inline constexpr float kDirected = 1e-3F;  ///< and above which it has a normal at all
inline constexpr float kSlim = 0.5F;       ///< of thickness over radius: the axes of its ellipsoid
inline constexpr float kSolid =
    0.55F;  ///< share of its ellipsoid's silhouette that it covers at most
inline constexpr float kDark =
    0.5F;  ///< share of its backs that counts where its radiance is dimmed

/// What a gather drew in place of children on lost pages (spec/shading.md#damage). The bound of a
/// receiver is on what that changes its occlusion by, and its irradiance in units of pi times the
/// greatest radiance around.
struct DamageCounts {
  std::uint64_t stand_ins = 0;  ///< clusters drawn in place of their children
  std::uint64_t receivers = 0;  ///< that see some of them
  double max_bound = 0;         ///< of one receiver, at most 1
  std::uint64_t bounds = 0;  ///< sum over receivers, in units of kBoundUnit: the same in any order

  static constexpr double kBoundUnit = 0x1p-32;
  /// So many receivers of one bound, at most 1.
  void add(std::uint64_t more, float bound) noexcept;
  void add(const DamageCounts& other) noexcept;
};

/// What a gather did.
struct GatherCounts {
  std::uint64_t receivers = 0;
  std::uint64_t cells = 0;          ///< receiver cells with more than one receiver
  std::uint64_t groups = 0;         ///< sibling groups read and tested
  std::uint64_t surfel_blocks = 0;  ///< runs of up to 8 surfels read and tested
  std::uint64_t clusters = 0;       ///< drawn
  std::uint64_t surfels = 0;        ///< drawn
  std::uint64_t retests = 0;  ///< clusters and surfels that one cell left and a cell in it tested
  DamageCounts damage;

  void add(const GatherCounts& other) noexcept;
};

}  // namespace ptc
