// Finds the point pages of a container that may hold points of a box, from the directory alone.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/base/surfel.h"
#include "engine/store/reader.h"

namespace ptc {

/// Returns the ranks of the point pages whose run of the Z-curve meets a box, ascending. A page
/// that is left out has no point in the box.
/// @param box  scene units, faces included
[[nodiscard]] std::vector<std::size_t> pages_in_box(const ContainerReader& container,
                                                    const Bounds& box);

}  // namespace ptc
