// What a gather asks of eight siblings or surfels at once, compiled for every instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#include <glm/vec3.hpp>

#include "engine/shade/disc_queue.h"
#include "engine/shade/receiver_cell.h"
#include "engine/shade/shading.h"
#include "format/node_page.h"

namespace ptc {

/// A receiver cell with the limits of its gather.
struct CellTest {
  ReceiverCell cell;
  double unit = 1;         ///< lattice unit in scene units
  float limit = 0;         ///< a cluster is small when r^2 < limit d^2
  float shared_from = 0;   ///< distance from which the cell settles things for all its receivers
  float inflation = 1;
  Sides sides = Sides::both;
  bool last = false;       ///< one receiver: everything is settled, the bands are zero
};

/// Children of a group: what becomes of them. Those drawn are in the queue.
struct GroupVerdict {
  unsigned keep = 0;  ///< left to the children of the cell
  unsigned open = 0;  ///< replaced by their own children
};

/// @param mask   children to look at
/// @param queue  with room for 8; discs relative to the cell's centre
GroupVerdict gather_group(const GroupView& group, unsigned mask, const CellTest& test, DiscQueue& queue);

/// @param payload, count  of a point page; up to 64 bytes past it may be read
/// @param first   index of the first surfel in the page
/// @param mask    which of the 8 surfels from `first` to look at
/// @param queue   as above
/// @return those left to the children of the cell
unsigned gather_surfels(const std::byte* payload, std::uint32_t count, std::uint32_t first, unsigned mask,
                        const CellTest& test, DiscQueue& queue);

}  // namespace ptc
