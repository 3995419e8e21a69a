// Merges the sorted points of a container with new ones, in a lattice that holds both.
//
// The new lattice doubles the old cube until it holds everything. Each doubling makes the old cube
// one octant of the new one, so old keys gain digits in front and keep their order:
//
//   +-------+-------+
//   |       |  new  |     old key  .abc...     new key  d.abc...     d: the octant of the old cube
//   +-------+-------+
//   |  old  |       |
//   +-------+-------+
#pragma once

#include <array>
#include <memory>

#include "engine/base/stream.h"
#include "format/morton.h"
#include "format/point_record.h"

namespace ptc {

/// The maximum number of doublings of a cube, which leaves 26 bits of the old lattice.
inline constexpr int kMaxDoublings = 16;

/// Returns the cube of `old`, doubled until it holds the box from `low` to `high` as well; `old`
/// itself when that holds the box. At each step the cube becomes an octant of the new one, so that
/// keys keep their order.
/// @param low, high  corners of the box, scene units
/// @throws std::invalid_argument as frame_around() does for such a box; RequestError when more than
///         kMaxDoublings would be needed
[[nodiscard]] Frame grow_frame(const Frame& old, const std::array<double, 3>& low,
                               const std::array<double, 3>& high);

/// Maps the keys of a frame to those of a frame that grow_frame() made from it.
class LatticeMove {
 public:
  LatticeMove(const Frame& old, const Frame& grown) noexcept;

  /// Returns whether the frames differ.
  [[nodiscard]] bool moves() const noexcept { return doublings_ > 0; }
  /// Returns the moved key. Ascending keys yield keys that do not descend. The position changes by
  /// less than one unit of the grown lattice.
  [[nodiscard]] MortonKey operator()(const MortonKey& key) const noexcept;

 private:
  int doublings_ = 0;
  LatticePoint offset_{};  ///< low corner of the old cube, in units of the grown lattice
};

/// Returns a stream of the same points with their keys moved.
/// @param sorted  must outlive the result
[[nodiscard]] std::unique_ptr<PointStream> move_points(PointStream& sorted,
                                                       const LatticeMove& move);

/// Returns the points of two streams by ascending key. Where keys are equal, the points of the
/// first stream come first.
/// @param first, second  sorted; must outlive the result
[[nodiscard]] std::unique_ptr<PointStream> merge_points(PointStream& first, PointStream& second);

}  // namespace ptc
