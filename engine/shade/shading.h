// The input and the output of shading, and its settings (spec/shading.md).
#pragma once

#include <cstdint>
#include <limits>

#include <glm/vec3.hpp>

#include "format/morton.h"

namespace ptc {

/// A place that is to be shaded.
struct Receiver {
  glm::dvec3 position{0};  ///< scene units, already lifted off its surface
  glm::vec3 normal{0};     ///< unit
};

/// The light that arrives at a receiver.
///
///     occlusion = 1 - 1/pi * integral of V(w) (n.w)           V(w) is 1 where nothing covers
///     sky       =            integral of V(w) L_sky(w) (n.w)  the direction w, and 0 elsewhere;
///     irradiance =           integral of L(w) (n.w)           L is the radiance of the surfel seen
///
/// Each integral is over the directions w of the hemisphere above the normal n.
struct Shading {
  float occlusion = 0;       ///< cosine-weighted share of the hemisphere that is covered, 0 to 1
  glm::vec3 bent_normal{0};  ///< unit mean of the uncovered directions; the normal when none is
  glm::vec3 irradiance{0};   ///< from surfaces, W/m^2
  glm::vec3 sky{0};          ///< from the environment where it is not covered, W/m^2
};

/// What a receiver's surface would send to an eye if it were a rough mirror that absorbs nothing
/// (spec/shading.md#glossy). Both are 0 where the eye sees its back.
struct Reflection {
  glm::vec3 radiance{0};  ///< of surfaces, with what they emit, and of the sky, W / (m^2 sr)
  float occlusion = 0;    ///< share of what the mirror shows that surfaces cover, 0 to 1
};

/// Which sides of a surfel stop light. Radiance always leaves the front alone.
enum class Sides {
  both,   ///< the back is black, and transparent to receivers within two radii of the centre
  front,  ///< the back is transparent: exact and faster where no back side is ever seen
};

/// The part of its surroundings that a receiver's occlusion is about
/// (spec/shading.md#surroundings).
struct Surroundings {
  /// All directions count alike, whatever the normal; otherwise those above it, by their cosine.
  bool sphere = false;
  /// Half angle of the cone about the normal in which directions count, rad; pi / 2 is the
  /// hemisphere. A sphere ignores it.
  float cone = 1.5707964F;
  /// Distance from which on surfaces cover nothing, scene units; infinite: none.
  float distance = std::numeric_limits<float>::infinity();
  /// That distance as a share of the diagonal of the scene's bounds; 0: `distance` holds. Requests
  /// take a share; for a gather it must be 0.
  float diagonals = 0;
  /// A surface at a distance d covers the share (1 - d / distance)^falloff of its direction: at 0
  /// all of it up to `distance`.
  unsigned falloff = 1;

  /// Says whether all directions above the normal count, by their cosine.
  [[nodiscard]] bool is_hemisphere() const noexcept { return !sphere && cone >= 1.5707963F; }
  /// Says whether this is the whole hemisphere at any distance.
  [[nodiscard]] bool is_plain() const noexcept {
    return is_hemisphere() && diagonals == 0 && distance == std::numeric_limits<float>::infinity();
  }
};

/// The settings of a gather: how closely it approximates exact discs (spec/shading.md#gather).
struct GatherOptions {
  /// Solid angle below which a cluster is drawn instead of being opened, sr: that of its bounding
  /// sphere, at the nearest receiver of a cell.
  float solid_angle = 0.01F;
  /// Angle within which all receivers of a cell must see a cluster for the cell to draw it once for
  /// all of them, rad.
  float parallax = 0.1F;
  /// Maximum footprint of a cluster that is not flat, over its projected area.
  float inflation = 2;
  unsigned resolution = 32;   ///< direction pixels along a cube edge, 16 to 64, a multiple of 16
  Sides sides = Sides::both;  ///< sides of surfels that stop light
  Surroundings around;        ///< what occlusion, bent normal and sky are about
  bool bleeding = true;       ///< false leaves out the light from surfaces, which takes less time
  /// Whether what surfaces emit is part of their light. False where emitters light the receivers
  /// otherwise (spec/shading.md#emission).
  bool emission = true;
};

// Constants of the disc that stands for a cluster (spec/shading.md#splats).

/// Length of the mean normal above which a cluster is drawn as one surfel.
inline constexpr float kFlat = 0.9F;
/// Length of the mean normal above which a cluster has a direction, so that it is drawn as an
/// ellipsoid about its mean normal and not as a ball.
inline constexpr float kDirected = 1e-3F;
/// Thickness in radii of the bounding sphere below which a cluster with a direction is a sheet, all
/// of whose surfels look along its mean normal or against it.
inline constexpr float kSheet = 0.2F;
/// Ratio of the ellipsoid's axes for a thickness of one radius of the bounding sphere.
inline constexpr float kSlim = 0.5F;
/// Maximum share of the ellipsoid's silhouette that a cluster covers.
inline constexpr float kSolid = 0.55F;
/// Share of a cluster's backs that counts where its radiance is dimmed by them.
inline constexpr float kDark = 0.5F;
/// Depth of the rim of the shallow paraboloid that stands for a disc, over the disc's radius. It
/// divides coplanar overlapping discs half way between their centres (spec/shading.md#surfels):
///
///     nearness
///        ^    _-~-_ _-~-_
///        |  -      X      -       X is half way between the centres, where both discs are
///        |-       - -       -     equally near
///        +---------------------
inline constexpr float kBump = 0.01F;

/// Counts of the clusters that a gather drew in place of children on lost pages
/// (spec/shading.md#damage).
///
/// The bound of a receiver limits how much the stand-ins change its occlusion, and also its
/// irradiance in units of pi times the greatest radiance around.
struct DamageCounts {
  std::uint64_t stand_ins = 0;  ///< clusters drawn in place of their children
  std::uint64_t receivers = 0;  ///< receivers that see some of them
  double max_bound = 0;         ///< greatest bound of one receiver, at most 1
  /// Sum of the bounds of all receivers, in units of kBoundUnit. It is an integer, so that the
  /// order of the sum does not matter.
  std::uint64_t bounds = 0;

  static constexpr double kBoundUnit = 0x1p-32;  ///< unit of `bounds`
  /// Adds receivers that share one bound.
  /// @param more   number of receivers
  /// @param bound  at most 1
  void add(std::uint64_t more, float bound) noexcept;
  /// Adds the counts of another gather.
  void add(const DamageCounts& other) noexcept;
};

/// Counts of the work that a gather did.
struct GatherCounts {
  std::uint64_t receivers = 0;      ///< receivers that were shaded
  std::uint64_t cells = 0;          ///< receiver cells with more than one receiver
  std::uint64_t groups = 0;         ///< sibling groups that were read and tested
  std::uint64_t surfel_blocks = 0;  ///< runs of up to 8 surfels that were read and tested
  std::uint64_t clusters = 0;       ///< clusters that were drawn
  std::uint64_t surfels = 0;        ///< surfels that were drawn
  std::uint64_t retests = 0;  ///< clusters and surfels that one cell left and a cell in it tested
  std::uint64_t rays = 0;     ///< rays at the borders of small openings
  DamageCounts damage;        ///< what was drawn in place of lost pages

  /// Adds the counts of another gather.
  void add(const GatherCounts& other) noexcept;
};

/// What some receivers of a gather take of its work. Of what a cell does for many, each takes an
/// equal share.
struct GatherWork {
  double receivers = 0;      ///< sum of the weights of the receivers
  double surfel_blocks = 0;  ///< as GatherCounts::surfel_blocks, weighted
  double clusters = 0;       ///< as GatherCounts::clusters, weighted
  double rays = 0;           ///< as GatherCounts::rays, weighted

  /// Adds the work of another gather.
  void add(const GatherWork& other) noexcept {
    receivers += other.receivers;
    surfel_blocks += other.surfel_blocks;
    clusters += other.clusters;
    rays += other.rays;
  }
};

}  // namespace ptc
