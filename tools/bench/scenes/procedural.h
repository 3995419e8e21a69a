// Scenes that need no file: what ptcbench measures beside real ones.
#pragma once

#include <cstdint>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc::bench {

/// A mesh with the light and the view that belong to it.
struct LitScene {
  Mesh mesh;
  LightRig lights;
  Camera camera;
};

/// Rough terrain under displaced balls: no wall is flat, every triangle is about as small as the
/// next. +y up, 100 units wide.
/// @param triangles  from 1000 on, as many come within 10 %
[[nodiscard]] LitScene make_fractal(std::uint64_t triangles);

/// A room of 6 x 3 x 4 m with thick walls, one red and one green, a table, a cupboard and a ball,
/// lit through one window by sun and sky: most of its light has met a surface.
[[nodiscard]] LitScene make_window_room();

/// Ground under sheets of tiles, half of them missing at random, one tile's width above each other:
/// what lies behind a surface grows with their number. +y up, 32 tiles wide.
[[nodiscard]] LitScene make_layers(unsigned layers);

}  // namespace ptc::bench
