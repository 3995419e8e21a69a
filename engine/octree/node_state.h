// Nodes of a tree as a program keeps them for its next run: with sums that are not rounded.
#pragma once

#include <cstdint>
#include <functional>

#include "engine/io/file/state_file.h"
#include "format/node_page.h"

namespace ptc {

/// Says whether a page may be one that groups lie on.
using KnowsPage = std::function<bool(std::uint32_t page)>;

/// Saves a node field by field.
void save_child(const NodeChild& child, StateWriter& state);
/// Loads a node that save_child() saved.
/// @param points  number of points so far, which its references must be below
/// @throws DataError when it refers to what does not exist, or a number is not finite
[[nodiscard]] NodeChild load_child(StateReader& state, const KnowsPage& knows,
                                   std::uint64_t points);

}  // namespace ptc
