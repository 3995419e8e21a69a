// Light of flat panels, by clipping: a truth without noise for scenes of boxes, floors and walls.
#pragma once

#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/shading.h"

namespace ptc::bench {

/// A flat convex polygon whose front shines.
struct Panel {
  std::vector<glm::dvec3> corners;  ///< counter-clockwise seen from the front, scene units
  glm::vec3 radiance{0};            ///< of the front, W / (m^2 sr)
};

/// Returns a parallelogram whose front is on the side of u x v.
[[nodiscard]] Panel panel(const glm::dvec3& corner, const glm::dvec3& u, const glm::dvec3& v,
                          const glm::vec3& radiance);
/// Adds the upper five sides of a box, all of one radiance.
void add_block(std::vector<Panel>& panels, const glm::dvec3& low, const glm::dvec3& high,
               const glm::vec3& radiance);

/// Returns the light of panels and of a constant sky at a receiver, without the bent normal.
///
/// What each panel shows of itself is cut out of it: a panel in front hides what lies in the
/// pyramid from the receiver through its corners, behind its plane. Lambert's formula weighs what
/// is left, so nothing is sampled.
///
///       receiver x ------.______ hidden
///                   \  [panel]  \.......
///                    `---._______\......
///
/// @param panels  those whose back looks at the receiver neither shine nor hide: the sides of
///                closed boxes, and sheets that no receiver sees from behind
/// @param sky     radiance where no panel is seen, W / (m^2 sr)
[[nodiscard]] Shading light_of_panels(const Receiver& receiver, std::span<const Panel> panels,
                                      const glm::vec3& sky);

/// Returns how near walls are that stand on a receiver's surface or hang over it: the distance to
/// the nearest panel that light_of_panels() counts, scene units; infinite where there is none.
/// @param panels  parallelograms
[[nodiscard]] double distance_to_walls(const Receiver& receiver, std::span<const Panel> panels);

}  // namespace ptc::bench
