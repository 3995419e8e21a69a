// Which side of a surface sees the sky.
//
//     d   d   d          Of the cells of a coarse grid, those with points are full. A cell sees the
//      \  |  /           sky in a direction when all cells that way are empty. Each place looks
//      from
//    . .\.|./. .         one cell on either side of its surface: the side that sees more of the sky
//    . .[ + ]. .         is the outer one. Underneath the ground and inside of houses there is no
//    =====*=====         sky, however open they are below.
//    . .[ - ]. .
//
// Where another surface is so near that it may lie between, as in a thin slab, nothing is said.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/scan/place_index.h"

namespace ptc {

/// The sky as a cloud sees it, in 16 directions at 10 degrees above the horizon and more.
///
/// Cells hold eight places in the mean, or more in a cloud of over a million.
/// Memory: kBytes while it is built, 4 MiB of them after finish().
/// Threads: after finish(), const calls may be made concurrently.
class SkyView {
 public:
  static constexpr int kDirections = 16;
  static constexpr std::uint64_t kBytes = std::uint64_t{5} << 20;

  SkyView();
  /// Adds a place of the cloud.
  void add(const LatticePosition& position) noexcept;
  /// Looks at the sky from all cells. @param up  unit
  void finish(const std::array<float, 3>& up);
  /// Returns the number of the cell of a place. Places of a cell follow one another along the
  /// curve.
  [[nodiscard]] std::size_t cell_of(const LatticePosition& position) const noexcept;
  /// Returns the width of a cell, lattice units.
  [[nodiscard]] double cell_width() const noexcept;
  /// Returns how much more of the sky a place sees on the side of its normal than on the other, in
  /// units of a direction: -kDirections to kDirections; 0 where other points are on the way to
  /// where it looks from. Directions along the surface do not count.
  [[nodiscard]] int more_in_front(const LatticePosition& position,
                                  const std::array<float, 3>& normal) const noexcept;

 private:
  static constexpr std::size_t kOutside = SIZE_MAX;

  void choose_cells();
  void look(std::size_t direction);
  /// Returns the number of the cell that lies so many cells along the normal, or kOutside.
  [[nodiscard]] std::size_t cell_along(const LatticePosition& position,
                                       const std::array<float, 3>& normal,
                                       float cells) const noexcept;

  int bits_;  ///< of a cell's number along an axis
  std::uint64_t places_ = 0;
  std::vector<bool> full_;  ///< by cell, x the fastest
  std::array<std::array<float, 3>, kDirections> directions_{};
  std::vector<std::uint16_t> seen_;  ///< by cell: a bit for each direction in which it sees the sky
};

}  // namespace ptc
