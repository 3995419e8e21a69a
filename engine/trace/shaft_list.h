// The boxes at which the rays of a shaft begin.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/trace/decoded_tree.h"
#include "engine/trace/trace_boxes.h"
#include "engine/trace/trace_kernels.h"

namespace ptc {

/// Walks the tree once for many rays, and lists the boxes that they may pass.
///
/// Threads: one for each thread.   Memory: 100 bytes for each of BoxList::kCapacity boxes.
class ShaftList {
 public:
  /// Lists the root alone, for rays in any direction.
  void list_root(const DecodedTree& tree);
  /// Lists what a shaft may pass. What is larger than the shaft is wide is opened while the list
  /// has room.
  /// @param place   what the shaft and the list are relative to, lattice units
  /// @param spread  growth of that width with the depth; 0: it counts as where the rays begin
  /// @throws FormatError when a page is damaged
  void list_along(DecodedTree& tree, const glm::dvec3& place, const Shaft& shaft, float spread);

  [[nodiscard]] const BoxList& boxes() const noexcept { return list_; }
  /// The references of the boxes, as trace_rays() wants them.
  [[nodiscard]] std::span<const std::uint64_t> words() const noexcept { return words_; }

 private:
  std::vector<ListedBox> items_;
  std::vector<std::uint64_t> opened_;  ///< references of groups to look at
  std::vector<std::uint64_t> words_;
  BoxList list_;
};

}  // namespace ptc
