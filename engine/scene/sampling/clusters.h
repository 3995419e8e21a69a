// Groups points of a surface into compact clusters of about equal size.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scene/sampling/surface_patches.h"

namespace ptc {

/// A group of surface points.
struct Cluster {
  glm::vec3 position{0};   ///< mean position of the members, relative to Mesh::origin
  glm::vec3 normal{0};     ///< mean normal of the members, unit
  std::uint32_t kind = 0;  ///< SurfacePoint::kind, which all members share
  /// Whether clusters lie next to it all around, so that the surface goes on there.
  bool is_enclosed = false;
};

/// Clusters points by Lloyd's method. The middles end up regularly spaced, each near the middle of
/// the surface that it stands for.
///
/// Clusters begin as equal stretches of the points. Then, `rounds` times, points join the nearest
/// cluster of their kind, where one that faces another way counts as farther away, and each cluster
/// moves to the middle of its members: some 8 points of each cluster at first, all points in the
/// last two rounds. So borders of clusters follow ridges.
/// @param points  in an order that keeps neighbours together, and kinds and opposite sides apart
/// @param count   wanted clusters; a number above points.size() counts as points.size()
/// @param rounds  0 keeps the equal stretches
/// @param owners  is overwritten with the cluster of each point; every cluster has a member
/// @return        `count` clusters, or fewer when some lost all members
/// Source: Lloyd 1982; Du, Faber and Gunzburger 1999.
[[nodiscard]] std::vector<Cluster> cluster_points(std::span<const SurfacePoint> points,
                                                  std::size_t count, unsigned rounds,
                                                  std::vector<std::uint32_t>& owners);

}  // namespace ptc
