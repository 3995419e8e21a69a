// What rays meet on their way down the tree, decoded once for many of them.
//
// All lengths are in edges of the frame. What belongs to one group or run of points is relative to
// an anchor near it, so that it serves rays from anywhere and floats lose nothing far from the
// frame's corner. A box is bounded by four pairs
// of planes: across x, y and z, and across the mean normal of what is in it, because surfaces are
// thin and seldom lie along an axis:
//
//       +------------------+
//       |    .-'''         |        between the slab's planes, and within the box
//       |.-'      .-'''    |
//       |    .-'           |
//       +------------------+
//
// Boxes lie in columns, one for each bound, so that kernels test kTraceLanes of them at once.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/scene_scale.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Radius of a disc as shadow rays meet it, over its own. In the edges of a room the discs of both
/// walls leave slivers free, through which a sun would shine everywhere in it.
inline constexpr float kRim = 1.2F;

/// What a tree is decoded for.
struct TraceRules {
  SceneScale::Factors lengths{1, 1};  ///< convert lengths from scene units to edges
  /// Radii of a disc within which its back is clear to rays that begin there: from clear_backs(), 0
  /// for rays of a camera, which see the backs of all discs.
  float clear_backs = 2;
  float rim = 1;  ///< radius of discs over their own, 1 or kRim
};

/// Returns TraceRules::clear_backs for rays of receivers.
[[nodiscard]] inline float clear_backs(Sides sides) noexcept {
  return sides == Sides::both ? 2 : std::numeric_limits<float>::infinity();
}

/// Share of a length that rounding may take from it where lengths are added up in floats.
inline constexpr float kTraceRounding = 4e-7F;

/// Boxes or discs that a kernel tests at once, at most.
inline constexpr std::size_t kTraceLanes = 8;
/// Discs in one block of a leaf: as many as a leaf has by default.
inline constexpr std::size_t kTraceDiscs = 16;

/// The columns of boxes.
enum BoxColumn : std::size_t {
  kLowX,  ///< bounds along the axes
  kLowY,
  kLowZ,
  kHighX,
  kHighY,
  kHighZ,
  kSlabX,  ///< unit normal of the slab
  kSlabY,
  kSlabZ,
  kSlabLow,  ///< what p . normal is at its planes
  kSlabHigh,
  kBoxColumns
};

/// The sibling nodes of a group.
struct alignas(64) TraceGroup {
  float columns[kBoxColumns][kTraceLanes];
  std::uint64_t child[kTraceLanes];  ///< references, as in the group (spec/nodes.md#node-group)
  glm::dvec3 anchor;                 ///< what the boxes are relative to, lattice units
  unsigned interior;                 ///< bit i: child i has a group
  unsigned children;                 ///< bit i: child i exists
};

/// The discs of kTraceLanes points.
struct alignas(64) TraceDiscs {
  float x[kTraceLanes], y[kTraceLanes], z[kTraceLanes];     ///< centre
  float nx[kTraceLanes], ny[kTraceLanes], nz[kTraceLanes];  ///< normal
  float radius2[kTraceLanes];  ///< square of the radius; negative where a point has no disc
  float bump[kTraceLanes];     ///< kBump over the radius
};

/// A run of up to kTraceDiscs points.
struct alignas(64) TraceLeaf {
  TraceDiscs discs[kTraceDiscs / kTraceLanes];
  glm::dvec3 anchor;  ///< what the discs are relative to, lattice units
  unsigned size;      ///< number of points
};

/// Where a ray begins, as something decoded sees it.
struct Beginning {
  float at[3];  ///< relative to the anchor, edges
  float slack;  ///< what rounding may take from distances to there, edges

  /// @param place, anchor  lattice units
  Beginning(const glm::dvec3& place, const glm::dvec3& anchor) noexcept {
    float sum = 0;
    for (int k = 0; k < 3; ++k) {
      at[k] = static_cast<float>((place[k] - anchor[k]) * SceneScale::kLatticeUnit);
      sum += std::abs(at[k]);
    }
    slack = kTraceRounding * sum;
  }
};

/// Boxes that many rays share, by ascending distance from a place near which the rays begin.
///
/// Memory: 52 bytes for each of kCapacity boxes.
struct BoxList {
  static constexpr std::size_t kCapacity = 512;
  static constexpr std::size_t kStride = kCapacity + kTraceLanes;  ///< floats of a column

  float columns[kBoxColumns][kStride];
  float distance[kStride];        ///< of the nearest point of the box
  std::uint32_t number[kStride];  ///< index into the words of the whole list
  std::size_t size = 0;
};

/// A box on its way to a list.
struct ListedBox {
  float distance = 0;  ///< of its nearest point, before which no ray enters it
  float columns[kBoxColumns] = {};
  std::uint64_t reference = 0;
  bool interior = false;

  ListedBox() = default;
  /// Takes child i of a group, with bounds relative to where the rays begin.
  ListedBox(const TraceGroup& group, std::size_t i, const Beginning& from) noexcept
      : reference(group.child[i]), interior((group.interior >> i & 1) != 0) {
    float along = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      columns[kLowX + k] = group.columns[kLowX + k][i] - from.at[k] - from.slack;
      columns[kHighX + k] = group.columns[kHighX + k][i] - from.at[k] + from.slack;
      columns[kSlabX + k] = group.columns[kSlabX + k][i];
      along += columns[kSlabX + k] * from.at[k];
    }
    columns[kSlabLow] = group.columns[kSlabLow][i] - along - from.slack;
    columns[kSlabHigh] = group.columns[kSlabHigh][i] - along + from.slack;
  }
  /// Returns the longest edge of the box.
  [[nodiscard]] float extent() const noexcept {
    float longest = 0;
    for (std::size_t k = 0; k < 3; ++k)
      longest = std::max(longest, columns[kHighX + k] - columns[kLowX + k]);
    return longest;
  }
};

/// Sorts boxes and makes a list of them.
/// @param boxes  at most BoxList::kCapacity
/// @param words  gets their references, by which rays follow them (trace_kernels.h)
inline void make_list(std::vector<ListedBox>& boxes, BoxList& list,
                      std::vector<std::uint64_t>& words) {
  std::ranges::sort(boxes, [](const ListedBox& a, const ListedBox& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.reference < b.reference;
  });
  words.resize(boxes.size());
  list.size = boxes.size();
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    for (std::size_t k = 0; k < kBoxColumns; ++k) list.columns[k][i] = boxes[i].columns[k];
    list.distance[i] = boxes[i].distance;
    list.number[i] = static_cast<std::uint32_t>(i << 1 | (boxes[i].interior ? 1 : 0));
    words[i] = boxes[i].reference;
  }
}

/// What was decoded last: a table with one place for each hash, as caches of processors have. What
/// is decoded depends on its key alone, so it does not matter what is still there.
template <class Value>
class DecodedTable {
 public:
  /// @param places  a power of two
  explicit DecodedTable(std::size_t places)
      : keys_(places, kNothing), values_(std::make_unique<Value[]>(places)) {}

  /// Returns what belongs to a key.
  /// @param decode  decode(value) fills the value when the table does not have it
  template <class Decode>
  const Value& find(std::uint64_t key, const Decode& decode) {
    const std::size_t at = (key * 0x9e3779b97f4a7c15U >> 32) & (keys_.size() - 1);
    if (keys_[at] != key) {
      keys_[at] = kNothing;  // so that nothing half decoded is found where decoding fails
      decode(values_[at]);
      keys_[at] = key;
    }
    return values_[at];
  }

 private:
  static constexpr std::uint64_t kNothing = ~std::uint64_t{0};  ///< no reference, and no run

  std::vector<std::uint64_t> keys_;
  std::unique_ptr<Value[]> values_;
};

}  // namespace ptc
