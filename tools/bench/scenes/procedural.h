// Scenes that need no file: ptcbench measures them in addition to those that are read from files.
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

/// Makes rough terrain under displaced balls: nothing is flat, and all triangles are of about one
/// size. +y is up, and the terrain is 100 units wide.
/// @param triangles  wanted; from 1000 on, the mesh has this many within 10 %
[[nodiscard]] LitScene make_fractal(std::uint64_t triangles);

/// Makes a room of 6 x 3 x 4 m with thick walls, one red and one green, a table, a cupboard and two
/// balls, lit through one window by sun and sky: most of the light in it has met a surface before.
/// +y is up, and the unit is a metre.
[[nodiscard]] LitScene make_window_room();

/// Makes two rooms of 4 x 2.8 x 4 m with thick walls and a door between them that is ajar: a lamp
/// below the ceiling of one lights the other, where the camera is, through the gap alone (after
/// Veach and Guibas 1997, Metropolis light transport, figure 3). +y is up, and the unit is a metre.
[[nodiscard]] LitScene make_ajar_rooms();

/// The lamp of make_cornell().
enum class CornellLamp {
  flat,  ///< a rectangle that shines downwards, just below the ceiling
  box,   ///< a box that shines to all sides and hangs below the ceiling
};

/// Makes a box of 2 x 2 x 2 units, open towards +z, with a red and a green wall, two blocks and a
/// lamp. +y is up. With a flat lamp surfaces have one side; with a box all materials are
/// double-sided, and light goes to and fro between the lamp's top and the ceiling.
[[nodiscard]] LitScene make_cornell(CornellLamp lamp);

/// Makes ground under sheets of tiles. Half of the tiles are missing at random, so the number of
/// surfaces behind a surface grows with the number of sheets (depth complexity):
///
///   sheet 2   ==  ====    ==  ==    sheets are one tile's width apart; +y is up
///   sheet 1   ====  ==  ====
///   ground    ==================    32 tiles wide, each of 1 x 1 unit
///
/// @param layers  sheets above the ground
[[nodiscard]] LitScene make_layers(unsigned layers);

}  // namespace ptc::bench
