// Grouping points of a surface into compact clusters of about equal size.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scene/sampling/surface_patches.h"

namespace ptc {

/// A group: its middle, and its members' mean normal, unit.
struct Cluster {
  glm::vec3 position{0};
  glm::vec3 normal{0};
  std::uint32_t kind = 0;
};

/// Clusters by Lloyd's method: equal stretches of the points to begin with, then `rounds` times
/// each point joins the nearest cluster that faces its way, and each cluster moves to its members'
/// middle. The middles end up regularly spaced, each near the middle of what it stands for.
/// @param points  in an order that keeps neighbours together, kinds and opposite sides apart
/// @param count   at most points.size(); more are as many
/// @param owners  is overwritten: for each point its cluster; every cluster has a member
/// @return        `count` clusters, or fewer when some lost all members
/// Source: Lloyd 1982; Du, Faber and Gunzburger 1999.
[[nodiscard]] std::vector<Cluster> cluster_points(std::span<const SurfacePoint> points,
                                                  std::size_t count, unsigned rounds,
                                                  std::vector<std::uint32_t>& owners);

}  // namespace ptc
