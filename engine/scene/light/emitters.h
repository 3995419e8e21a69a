// The emissive triangles of a mesh, cut into pieces of one radiance each.
#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"

namespace ptc {

/// A triangle that emits on its front side. Coordinates are relative to Mesh::origin, or to the
/// origin of a LightRays.
struct Emitter {
  glm::vec3 corner[3];    ///< counter-clockwise as seen from the emitting side
  glm::vec3 radiance{0};  ///< W/(m^2 sr)
};

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
