// What the discs of a container cover, for the gather.
#pragma once

#include "engine/shade/gather/openings.h"

namespace ptc {

/// Makes exact rays at discs, through the octree. Each Visibility takes a reader of the cache and
/// the memory of a DiscTracer, and 56 bytes for each ray.
/// @param sides  sides of discs that cover
[[nodiscard]] VisibilityMaker disc_visibility(Sides sides);

}  // namespace ptc
