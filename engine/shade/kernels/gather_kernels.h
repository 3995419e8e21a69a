// What a gather asks of eight clusters or surfels at once, compiled for every instruction set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/gather/near_lists.h"
#include "engine/shade/gather/receiver_cell.h"
#include "engine/shade/kernels/disc_queue.h"
#include "engine/shade/scene_scale.h"
#include "engine/shade/shading.h"
#include "format/node_page.h"

namespace ptc {

/// A receiver cell with the limits of its gather. Lengths are in edges of the frame.
struct CellTest {
  ReceiverCell cell;
  double unit = SceneScale::kLatticeUnit;  ///< lattice unit
  SceneScale::Factors lengths{1, 1};       ///< from scene units
  SceneScale::Factors areas{1, 1};         ///< likewise
  float limit = 0;                         ///< a cluster is small when r^2 < limit d^2
  float shared_from = 0;  ///< distance from which the cell settles things for all its receivers
  float inflation = 1;
  Sides sides = Sides::both;
  bool bleeding = true;  ///< colours are wanted
  bool last = false;     ///< nothing is left to children: everything is settled
  bool damaged = false;  ///< some clusters may be closed: they are drawn, not opened
};

/// What a cell draws, and what it leaves; all relative to its centre.
struct CellOutput {
  DiscQueue& queue;
  NearLists* left;                        ///< null when `last`
  std::vector<ClusterPayload>& payloads;  ///< of the clusters left, appended
  unsigned stand_ins = 0;  ///< closed clusters that were drawn and would have been opened
  float stand_in_share =
      0;  ///< of the hemisphere that they may cover, for any receiver of the cell
};

/// Looks at the children of a group.
/// @param closed  bit i: child i cannot be opened; 0 unless the test is of a damaged scene
/// @param out  its queue has room for 8
/// @return  bit i: child i is replaced by its own children
unsigned gather_group(const GroupView& group, unsigned closed, const CellTest& test,
                      CellOutput& out);

/// Looks at clusters that the cell around left, from index `from` on, until the queue is full.
/// @param move    of positions, from that cell's centre to this one's
/// @param opened  indices of payloads of clusters that are replaced by their children, appended
/// @return  the first index that it has not looked at
std::size_t gather_clusters(const NearClusters& near, std::size_t from, const glm::vec3& move,
                            const CellTest& test, CellOutput& out,
                            std::vector<std::uint32_t>& opened);

/// Looks at surfels of a page.
/// @param payload, count  of a point page; up to 64 bytes past it may be read
/// @param first, number   of them, at most 8
/// @param out  its queue has room for 8
void gather_page_surfels(const std::byte* payload, std::uint32_t count, std::uint32_t first,
                         unsigned number, const CellTest& test, CellOutput& out);

/// Looks at surfels that the cell around left, as gather_clusters().
std::size_t gather_surfels(const NearSurfels& near, std::size_t from, const glm::vec3& move,
                           const CellTest& test, CellOutput& out);

}  // namespace ptc
