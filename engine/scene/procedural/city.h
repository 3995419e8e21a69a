// A procedural city of any size, streamed: the scene for tests of scale.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/base/surfel.h"
#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// Makes a city as a stream of lit surfels.
///
/// Streets, buildings with ledges and roof boxes, trees and rolling ground stand on blocks of 16 m,
/// +y up. Blocks are laid in a square spiral around the origin:
///
///      4  3  2 11
///      5  0  1 10      The number of blocks grows with the point count, at a spacing of 0.25 m;
///      6  7  8  9      a city of one block is sampled more coarsely.
///
/// A formula of sun and sky lights the points, so that no ray is traced. The same count gives the
/// same points on every machine. Points come block by block.
/// @param count  wanted points; from a thousand on, the stream is within 5 % of it
/// Memory: one block's points, about 4 MB.
[[nodiscard]] std::unique_ptr<PointSource> make_city(std::uint64_t count);

/// Some of the blocks of a city, by their numbers along the spiral.
struct CityBlocks {
  std::uint64_t first = 0;
  std::uint64_t end = 0;   ///< number after the last block, at most city_blocks()
  std::uint64_t step = 1;  ///< takes the first of every so many blocks, 1 or more
};
/// Makes some of the blocks of make_city(count), as they come there.
[[nodiscard]] std::unique_ptr<PointSource> make_city(std::uint64_t count, const CityBlocks& blocks);
/// Returns the number of blocks of make_city(count).
[[nodiscard]] std::uint64_t city_blocks(std::uint64_t count);
/// Returns the sun and the sky of the formula that lights make_city().
[[nodiscard]] LightRig city_lights();
/// Returns a box that holds every point of make_city(count) and every vertex of city_mesh(count),
/// metres.
[[nodiscard]] Bounds city_bounds(std::uint64_t count);
/// Makes the city of make_city(count) as a mesh, for ray-traced references and pictures. Every
/// point lies on a triangle of its colour and normal, within float rounding.
/// @throws RequestError when the mesh would have 2^32 vertices or more
[[nodiscard]] Mesh city_mesh(std::uint64_t count);

}  // namespace ptc
