// A procedural city of any size, streamed: the scale test.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/base/surfel.h"
#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// Streets, buildings with ledges and roof boxes, trees, rolling ground: blocks of 16 m, laid in a
/// square spiral around the origin, +y up, whose number grows with the point count at a spacing of
/// 0.25 m; a city of one block is sampled more coarsely. Lit by a formula of sun and sky, so that
/// no ray is traced. The same count gives the same points everywhere. Points come block by block.
/// @param count  wanted points; what comes is within 5 % from a thousand on
/// Memory: one block's points, about 4 MB.
[[nodiscard]] std::unique_ptr<PointSource> make_city(std::uint64_t count);
/// The sun and sky of that formula.
[[nodiscard]] LightRig city_lights();
/// A box that holds every point of make_city(count) and every vertex of city_mesh(count).
[[nodiscard]] Bounds city_bounds(std::uint64_t count);
/// The same city as a mesh, for ray-traced references and pictures: every point lies on a triangle
/// of its colour and normal, within float rounding.
/// @throws RequestError when it would have 2^32 vertices or more
[[nodiscard]] Mesh city_mesh(std::uint64_t count);

}  // namespace ptc
