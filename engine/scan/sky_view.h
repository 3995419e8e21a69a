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
// Finer cells tell where it may lie, so that walls of a narrow yard have a side, too.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/scan/place_index.h"

namespace ptc {

/// The cells of a cubic grid over the lattice that hold places.
class FullCells {
 public:
  /// @param bits  of a cell's number along an axis
  explicit FullCells(int bits) : bits_(bits), full_(std::size_t{1} << (3 * bits)) {}

  void add(const LatticePosition& position) noexcept { fill(cell_of(position)); }
  /// Makes cells that are twice as wide.
  void halve();

  [[nodiscard]] int bits() const noexcept { return bits_; }
  /// Returns the width of a cell, lattice units.
  [[nodiscard]] double width() const noexcept;
  /// Returns the number of all cells.
  [[nodiscard]] std::size_t size() const noexcept { return full_.size(); }
  /// Returns the number of cells that hold places.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// Says whether a cell holds a place.
  [[nodiscard]] bool operator[](std::size_t cell) const noexcept { return full_[cell]; }
  /// Says whether a cell, or one that shares a face with it, holds a place.
  [[nodiscard]] bool is_near(std::size_t cell) const noexcept;
  /// Returns the number of the cell of a place: x is the fastest. Places of a cell follow one
  /// another along the curve.
  [[nodiscard]] std::size_t cell_of(const LatticePosition& position) const noexcept;
  /// Returns the cell that lies so many cells along a vector, by axis. It may be outside.
  [[nodiscard]] std::array<int, 3> along(const LatticePosition& position,
                                         const std::array<float, 3>& vector,
                                         float cells) const noexcept;
  /// Says whether a cell is one of the grid.
  [[nodiscard]] bool holds(const std::array<int, 3>& cell) const noexcept;
  /// Returns the number of a cell of the grid.
  [[nodiscard]] std::size_t number(const std::array<int, 3>& cell) const noexcept;

 private:
  void fill(std::size_t cell) noexcept {
    count_ += full_[cell] ? 0U : 1U;
    full_[cell] = true;
  }

  int bits_;
  std::vector<bool> full_;
  std::uint64_t count_ = 0;
};

/// The sky as a cloud sees it, in 16 directions at 10 degrees above the horizon and more.
///
/// Cells hold eight places in the mean, or more in a cloud of over a million.
/// Memory: kBytes while it is built.
/// Threads: after finish(), const calls may be made concurrently.
class SkyView {
 public:
  static constexpr int kDirections = 16;
  static constexpr std::uint64_t kBytes = std::uint64_t{25} << 18;

  SkyView();
  /// Adds a place of the cloud.
  void add(const LatticePosition& position) noexcept;
  /// Looks at the sky from all cells. @param up  unit
  void finish(const std::array<float, 3>& up);

  /// Returns the cells from which the sky is looked at.
  [[nodiscard]] const FullCells& cells() const noexcept { return cells_; }
  /// Returns the finest cells that are full wherever there is a surface: those of cells(), or some
  /// of half their width.
  [[nodiscard]] const FullCells& fine_cells() const noexcept { return fine_; }
  /// Returns how much more of the sky a place sees on the side of its normal than on the other, in
  /// units of a direction: -kDirections to kDirections; 0 where other points are on the way to
  /// where it looks from. Directions along the surface do not count.
  [[nodiscard]] int more_in_front(const LatticePosition& position,
                                  const std::array<float, 3>& normal) const noexcept;
  /// Returns 1 where the side of the normal is in the open and the other one is not, -1 where it is
  /// the other way round, 0 where both or none are, or other points are on the way to where the
  /// place looks from. In the open, more of the sky is seen than through a gap of a surface.
  [[nodiscard]] int open_side(const LatticePosition& position,
                              const std::array<float, 3>& normal) const noexcept;

 private:
  /// What can be said of a cell.
  enum class Air : std::uint8_t { unclear, hidden, open };

  void look(std::size_t direction);
  [[nodiscard]] Air air_at(const std::array<int, 3>& fine_cell) const noexcept;

  FullCells fine_, cells_;
  std::uint64_t places_ = 0;
  std::array<float, 3> up_{};
  std::array<std::array<float, 3>, kDirections> directions_{};
  std::vector<std::uint16_t> seen_;  ///< by cell: a bit for each direction in which it sees the sky
};

}  // namespace ptc
