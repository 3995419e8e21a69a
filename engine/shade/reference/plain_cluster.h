// A cluster of surfels as the columns of its group describe it, decoded one number at a time.
#pragma once

#include <array>

#include <glm/vec3.hpp>

#include "format/morton.h"
#include "format/node_page.h"

namespace ptc {

/// A child of a group relative to a receiver, in scene units.
struct Cluster {
  glm::vec3 to{0};  ///< mean position
  float radius = 0;
  float area = 0;
  float thickness = 0;
  std::array<float, 6> facing{};  ///< share of the area that faces each axis
  glm::vec3 mean{0};              ///< sum of area times normal over the area; not unit
  float flatness = 0;             ///< length of `mean`
};

/// Decodes child i of a group.
/// @param from  position of the receiver, scene units
[[nodiscard]] Cluster read_cluster(const GroupView& group, int i, const Frame& frame,
                                   const glm::dvec3& from);

/// The light that leaves a cluster in a direction by the three faces of the ambient cube that look
/// there.
struct Front {
  float area = 0;         ///< projected area of the fronts over the cluster's area
  glm::vec3 radiance{0};  ///< sum of their radiance times that area
};

/// Returns the light that leaves child i of a group. @param toward  unit
[[nodiscard]] Front front_of(const GroupView& group, int i, const Cluster& c,
                             const glm::vec3& toward);

}  // namespace ptc
