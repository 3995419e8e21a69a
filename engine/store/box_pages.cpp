// A page holds a run of the Z-curve, from its first key to the first key of the next page. The
// directory has the upper half of these keys: 21 levels of the octree. A run meets a box when one
// of its cells does, which a descent finds; only cells that straddle an end of the run, or the
// border of the box, are divided:
//
//     +-----+-----+
//     |  ..run->  |      cell outside of the run, or outside of the box    no
//     +-----+--[box]     cell inside of the run, or inside of the box      yes
//     |  -> |  [  |]     else                                              ask its eight children
//     +-----+-----+
#include "engine/store/box_pages.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "format/morton.h"

namespace ptc {
namespace {

constexpr int kLevels = 21;  // of the upper half of a key

/// A box of cells of the finest of these levels, corners included.
struct CellBox {
  LatticePoint low, high;
};

/// A run of the curve: the upper halves of its first and last key.
struct Run {
  std::uint64_t first, last;
};

/// Says whether a cell holds a part of the run that may lie in the box.
/// @param key    upper half of the first key of the cell
/// @param level  of the cell, 0 to kLevels
bool meets(const Run& run, const CellBox& box, std::uint64_t key, int level) {
  const std::uint64_t keys = std::uint64_t{1} << (3 * (kLevels - level));
  const std::uint64_t last = key + (keys - 1);
  if (last < run.first || key > run.last) return false;
  const LatticePoint corner = decode_morton({key, 0});
  const std::uint64_t edge = (std::uint64_t{1} << (kLevels - level)) - 1;  // less one cell
  bool inside = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::uint64_t from = corner[axis] >> kLevels, to = from + edge;
    if (to < box.low[axis] || from > box.high[axis]) return false;
    inside = inside && from >= box.low[axis] && to <= box.high[axis];
  }
  if (inside || (key >= run.first && last <= run.last)) return true;
  for (std::uint64_t child = 0; child < 8; ++child) {
    if (meets(run, box, key + child * (keys / 8), level + 1)) return true;
  }
  return false;
}

}  // namespace

std::vector<std::size_t> pages_in_box(const ContainerReader& container, const Bounds& box) {
  const Frame& frame = container.header().frame;
  const auto cell = [&](const glm::dvec3& p) {
    LatticePoint point = frame.to_lattice({p.x, p.y, p.z});
    for (auto& coordinate : point) coordinate >>= kLevels;
    return point;
  };
  const CellBox cells{cell(box.low), cell(box.high)};
  const PageNumbers::Range pages = container.point_pages();
  std::vector<std::size_t> ranks;
  for (std::size_t rank = 0; rank < pages.size(); ++rank) {
    Run run{container.entry(pages[rank]).first_key, ~std::uint64_t{0}};
    if (rank + 1 < pages.size()) run.last = container.entry(pages[rank + 1]).first_key;
    if (meets(run, cells, 0, 0)) ranks.push_back(rank);
  }
  return ranks;
}

}  // namespace ptc
