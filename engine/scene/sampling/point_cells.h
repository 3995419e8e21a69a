// The cells of a grid that points of a surface lie in, and those around each.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scene/sampling/surface_patches.h"

namespace ptc {

/// Numbers the cells that points lie in, and lists for each those that can hold what is next to its
/// points. Cells come in levels, each half as wide as those of the level before, so that there are
/// wide cells where points are far apart, and narrow ones where they are dense:
///
///     +-------+-------+---+---+
///     |       |       | . | : |    The cells around a cell are its 26 neighbours in its level. In
///     |   .   |   .   +---+---+    other levels, they are those that lie in a neighbour, or that a
///     |       |       | : | . |    neighbour lies in.
///     +-------+-------+---+---+
///
/// Only cells with points have a number, so that memory grows with the points. The numbers of cells
/// that follow each other along x follow each other, too.
class PointCells {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  /// @param points  one or more
  /// @param groups  index of the group of each point
  /// @param reach   of each group: its points' cells are as narrow as this allows
  PointCells(std::span<const SurfacePoint> points, std::span<const std::uint32_t> groups,
             std::span<const float> reach);

  /// Cells of successive numbers.
  struct Range {
    std::uint32_t first, end;
  };

  /// Returns the number of cells.
  [[nodiscard]] std::size_t size() const noexcept { return keys_.size(); }
  /// Returns the number of the cell that a point lies in.
  [[nodiscard]] std::uint32_t of_point(std::size_t point) const { return cell_of_[point]; }
  /// Returns the level of a cell's number.
  [[nodiscard]] std::size_t level_of(std::uint32_t cell) const {
    return static_cast<std::size_t>(keys_[cell] >> kLevelShift);
  }
  /// Returns the number of the cell at a position, or kNone where no point has that cell.
  [[nodiscard]] std::uint32_t find(std::size_t level, const glm::vec3& position) const;
  /// Returns the numbers of a cell and of those around it.
  [[nodiscard]] std::span<const Range> around(std::uint32_t cell) const {
    return {around_.data() + begins_[cell], begins_[cell + 1] - begins_[cell]};
  }

 private:
  static constexpr std::size_t kLevels = 8;
  static constexpr int kLevelShift = 60;
  using Index = std::array<std::uint64_t, 3>;

  static constexpr std::uint64_t kUpY = std::uint64_t{1} << 20;  // from a key to the next along y
  static constexpr std::uint64_t kUpZ = std::uint64_t{1} << 40;
  static constexpr std::uint64_t kIndexMask = kUpY - 1;

  // Packs a cell into a number: level in 4 bits, then z, y and x in 20 bits each.
  static std::uint64_t key_of(std::size_t level, const Index& at) {
    return std::uint64_t{level} << kLevelShift | at[2] * kUpZ | at[1] * kUpY | at[0];
  }
  [[nodiscard]] Index index_at(std::size_t level, const glm::vec3& position) const;
  // Returns the slot of a key by linear probing: that of its cell, or the empty one where it would
  // go.
  [[nodiscard]] std::size_t slot(std::uint64_t key) const;
  [[nodiscard]] std::uint32_t number_of(std::uint64_t key);
  void fill_table(std::size_t size);
  void sort();
  void list_around();
  // A cell, and cells of another level around it.
  struct Pair {
    std::uint32_t cell;
    Range range;
  };
  // Returns what lies around cells in other levels, by cell.
  [[nodiscard]] std::vector<Pair> across_levels() const;

  glm::vec3 low_{0};
  std::array<float, kLevels> width_{};  // of the cells of each level
  std::vector<std::uint32_t> cell_of_;  // for each point
  std::vector<std::uint64_t> keys_;     // of each cell, ascending
  std::vector<std::uint32_t> table_;    // open addressing: numbers of cells
  std::vector<std::uint32_t> begins_;   // of each cell's ranges in around_, then the end
  std::vector<Range> around_;
};

}  // namespace ptc
