// What the tests of this layer do with meshes and sources.
#pragma once

#include <vector>

#include "engine/io/cloud/points.h"
#include "engine/io/mesh/mesh.h"
#include "tools/bench/shapes/meshes.h"
#include "tools/bench/shapes/random.h"

namespace ptc {

using bench::add_box;
using bench::add_quad;
using bench::add_triangle;
using bench::empty_mesh;
using bench::ground;
using bench::Random;
using bench::sphere;
using bench::turn;

/// Returns the area of one side of all triangles.
[[nodiscard]] double one_sided_area(const Mesh& mesh);
[[nodiscard]] std::vector<Surfel> drain(PointSource& source, std::size_t block = 1000);

}  // namespace ptc
