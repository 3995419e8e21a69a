// The decisions of a gather for up to eight clusters or surfels at once, compiled for every
// instruction set.
//
// A cell of receivers looks at a thing, a cluster or a surfel, and does one of four things with it:
//
//     drop    it lies below the horizon of every receiver, or shows them only clear backs
//     draw    it is small enough, and far enough to look the same to all receivers of the cell
//     open    it is a cluster that is too large for every receiver, or far enough although it is
//             too large for some: its children are looked at for this cell
//     keep    it is near, or only some receivers would open it: the cells within look at it again
//
//                  near: d < rho / parallax         far
//     small        keep                             draw
//     not small    open when every receiver of      open
//                  the cell would, else keep
//
// A cell that has kept much also keeps what it would open, where all of that is near: it would keep
// the parts (CellTest::kept_within).
//
// d is the distance from the cell's centre and rho the cell's radius; a surfel is always small.
// A small thing just beyond the border is drawn and kept as well, so that no gap opens
// (spec/shading.md#seams). A cell of one receiver draws or opens everything.
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
  ReceiverCell cell;                  ///< its radius and depth in edges of the frame
  SceneScale::Factors lengths{1, 1};  ///< convert lengths from scene units to edges
  SceneScale::Factors areas{1, 1};    ///< convert areas from scene units to edges
  float limit = 0;            ///< a cluster of radius r at distance d is small when r^2 < limit d^2
  float shared_from = 0;      ///< distance from which the cell settles things for all receivers
  float inflation = 1;        ///< GatherOptions::inflation
  Sides sides = Sides::both;  ///< sides of surfels that stop light
  bool bleeding = true;       ///< whether colours are wanted
  bool emission = true;       ///< whether what surfels emit is part of their colours
  bool last = false;          ///< whether everything is settled and nothing left to children
  bool damaged = false;       ///< whether some clusters may be closed: drawn, and never opened
  float kept_within = 0;      ///< clusters all of which is nearer are never opened
};

/// The output of a cell: what it draws, and what it leaves to its children. Positions are relative
/// to its centre.
struct CellOutput {
  DiscQueue& queue;                       ///< discs to draw, appended
  NearLists* left;                        ///< things left to children, appended; null when `last`
  std::vector<ClusterPayload>& payloads;  ///< payloads of the clusters that are left, appended
  unsigned stand_ins = 0;  ///< closed clusters that were drawn and would have been opened
  /// Share of the hemisphere that the stand-ins may cover, for any receiver of the cell.
  float stand_in_share = 0;
};

/// Looks at the children of a group.
/// @param closed  bit i: child i cannot be opened; 0 unless `test.damaged`
/// @param out     its queue has room for 8 discs
/// @return        bit i: child i is to be replaced by its own children
unsigned gather_group(const GroupView& group, unsigned closed, const CellTest& test,
                      CellOutput& out);

/// Looks at clusters that the enclosing cell left, from index `from` on, until the queue is full.
/// @param move    is added to positions: the enclosing cell's centre relative to this one's
/// @param opened  indices in `near` of clusters that are to be replaced by their children, appended
/// @return        the first index that it has not looked at; near.size at the end
std::size_t gather_clusters(const NearClusters& near, std::size_t from, const glm::vec3& move,
                            const CellTest& test, CellOutput& out,
                            std::vector<std::uint32_t>& opened);

/// Looks at surfels of a point page.
/// @param payload  of the page; up to 64 bytes past its end may be read
/// @param count    number of points on the page
/// @param emits    whether the page has the columns of emission
/// @param first    index of the first surfel to look at
/// @param number   how many surfels to look at, at most 8
/// @param out      its queue has room for 8 discs
void gather_page_surfels(const std::byte* payload, std::uint32_t count, bool emits,
                         std::uint32_t first, unsigned number, const CellTest& test,
                         CellOutput& out);

/// Looks at surfels that the enclosing cell left, from index `from` on, until the queue is full.
/// @param move  is added to positions: the enclosing cell's centre relative to this one's
/// @return      the first index that it has not looked at; near.size at the end
std::size_t gather_surfels(const NearSurfels& near, std::size_t from, const glm::vec3& move,
                           const CellTest& test, CellOutput& out);

}  // namespace ptc
