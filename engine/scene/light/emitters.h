// The emissive triangles of a mesh, cut into pieces of one radiance each.
#pragma once

#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// A triangle that emits on its front side. Coordinates are relative to Mesh::origin, or to the
/// origin of a LightRays.
struct Emitter {
  glm::vec3 corner[3];    ///< counter-clockwise as seen from the emitting side
  glm::vec3 radiance{0};  ///< W/(m^2 sr)
};

/// Returns the normal of an emitter, as long as twice its area.
[[nodiscard]] inline glm::dvec3 twice_area_of(const Emitter& emitter) noexcept {
  const glm::dvec3 a(emitter.corner[0]);
  return glm::cross(glm::dvec3(emitter.corner[1]) - a, glm::dvec3(emitter.corner[2]) - a);
}

/// Returns the power of an emitter, up to a factor that all share.
[[nodiscard]] inline double power_of(const Emitter& emitter) noexcept {
  return glm::length(twice_area_of(emitter)) * brightness(emitter.radiance);
}

/// Returns the emissive triangles of a mesh. A triangle whose emission has a texture is cut where
/// that varies, until each piece has about one radiance, which is the mean of the texture there.
/// Pieces that do not emit are left out.
///
///     +-------+       +---+---+
///     |dark  /|       |  /| \ |      The lit corner of a screen is cut finely, the rest is left
///     |    /**|  -->  |/  |*\*|      whole: at most 65,536 pieces for all textured triangles, or
///     |  /****|       |  /|**\|      one for each of them where there are more
///     +-------+       +-------+
///
/// Memory: 48 bytes for each triangle or piece.
[[nodiscard]] std::vector<Emitter> emitters_of(const Mesh& mesh);

}  // namespace ptc
