// Sorted points of a container and more, in one order.
#pragma once

#include <array>
#include <memory>

#include "engine/sort/external_sort.h"
#include "format/morton.h"

namespace ptc {

/// Most doublings of a cube that is to hold more: 26 bits of the old lattice are left then.
inline constexpr int kMaxDoublings = 16;

/// The cube of `old`, doubled until it holds a box, too: at each step it becomes an octant of the
/// new one, so that keys keep their order. The old frame when it holds the box.
/// @throws std::invalid_argument as frame_around(); RequestError when more than kMaxDoublings
/// would be needed
[[nodiscard]] Frame grow_frame(const Frame& old, const std::array<double, 3>& low,
                               const std::array<double, 3>& high);

/// Where the lattice points of a frame lie in one that grow_frame() made of it.
class LatticeMove {
 public:
  LatticeMove(const Frame& old, const Frame& grown) noexcept;

  [[nodiscard]] bool moves() const noexcept { return doublings_ > 0; }
  /// Of ascending keys the results do not descend. The position changes by less than a unit of the
  /// grown lattice.
  [[nodiscard]] MortonKey operator()(const MortonKey& key) const noexcept;

 private:
  int doublings_ = 0;
  LatticePoint offset_{};  ///< of the old cube, in units of the grown lattice
};

/// Points with their keys moved. @param sorted  must outlive the result
[[nodiscard]] std::unique_ptr<PointStream> move_points(PointStream& sorted,
                                                       const LatticeMove& move);

/// The points of two streams by ascending key, those of the first before those of the second where
/// keys are equal.
/// @param first, second  sorted; must outlive the result
[[nodiscard]] std::unique_ptr<PointStream> merge_points(PointStream& first, PointStream& second);

}  // namespace ptc
