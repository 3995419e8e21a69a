// What rays from one origin meet on their way down the tree, decoded once for all of them.
//
// All lengths are in edges of the frame and relative to the origin. A box is bounded by four pairs
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
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/shade/scene_scale.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Radius of a disc as shadow rays meet it, over its own. In the edges of a room the discs of both
/// walls leave slivers free, through which a sun would shine everywhere in it.
inline constexpr float kRim = 1.2F;

/// Where the rays start for which a tree is decoded: at one place, or around it.
struct RayStarts {
  glm::dvec3 origin{0};               ///< lattice units
  glm::vec3 axis{0};                  ///< discs below the horizon of this normal are left out
  SceneScale::Factors lengths{1, 1};  ///< convert lengths from scene units to edges
  Sides sides = Sides::both;          ///< which sides stop rays
  /// Shadow rays start around the origin: each finds itself which backs are clear, and discs have a
  /// rim of kRim.
  bool around = false;
  float reach = 0;  ///< how far from the origin rays start at most, edges
};

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
  unsigned interior;                 ///< bit i: child i has a group
  unsigned children;                 ///< bit i: child i exists
};

/// A run of up to kTraceDiscs points. Discs that no ray from the origin can meet are left out.
struct alignas(64) TraceLeaf {
  float x[kTraceDiscs], y[kTraceDiscs], z[kTraceDiscs];     ///< centre
  float nx[kTraceDiscs], ny[kTraceDiscs], nz[kTraceDiscs];  ///< normal
  float height[kTraceDiscs];         ///< centre . normal; negative where the origin sees the front
  float radius2[kTraceDiscs];        ///< square of the radius
  float bump[kTraceDiscs];           ///< kBump over the radius
  std::uint8_t number[kTraceDiscs];  ///< of the disc in the run
  unsigned size;                     ///< discs that are left
};

/// Boxes that many rays share, by ascending distance from the origin.
///
/// Memory: 52 bytes for each of kCapacity boxes.
struct BoxList {
  static constexpr std::size_t kCapacity = 512;

  float columns[kBoxColumns][kCapacity + kTraceLanes];
  float distance[kCapacity + kTraceLanes];        ///< of the nearest point of the box
  std::uint32_t number[kCapacity + kTraceLanes];  ///< index into the words of the whole list
  std::size_t size = 0;
};

/// A box on its way to a list.
struct ListedBox {
  float distance;  ///< of its nearest point, before which no ray enters it
  float columns[kBoxColumns];
  std::uint64_t reference;
  bool interior;
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
      : keys_(places, Key{}), values_(std::make_unique<Value[]>(places)) {}

  /// Forgets everything.
  void clear() noexcept { ++turn_; }
  /// Returns what belongs to a key.
  /// @param decode  decode(value) fills the value when the table does not have it
  template <class Decode>
  const Value& find(std::uint64_t key, const Decode& decode) {
    const std::size_t at = (key * 0x9e3779b97f4a7c15U >> 32) & (keys_.size() - 1);
    if (keys_[at].turn != turn_ || keys_[at].key != key) {
      keys_[at].turn = 0;  // so that nothing half decoded is found where decoding fails
      decode(values_[at]);
      keys_[at] = {key, turn_};
    }
    return values_[at];
  }

 private:
  struct Key {
    std::uint64_t key = 0;
    std::uint64_t turn = 0;  ///< 0: nothing
  };
  std::vector<Key> keys_;
  std::unique_ptr<Value[]> values_;
  std::uint64_t turn_ = 1;
};

}  // namespace ptc
