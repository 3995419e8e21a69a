// The spacings of surfels that places of a surface ask for.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include <glm/vec3.hpp>

namespace ptc {

/// Spacings that places ask for. A cell of a grid keeps the finest that a place in it asks for.
/// Each level above has cells twice as wide, so that a large ball looks at as few as a small one:
///
///     level 0    | 1 | 2 | 2 | 4 |   | 4 |     a cell without places asks for nothing
///     level 1    |   1   |   2   |   4   |
///     level 2    |       1       |   4   |
///
/// Memory: about 80 bytes for each cell of level 0.
/// Threads: const members may be called concurrently.
class SpacingMap {
 public:
  /// The spacing that a place asks for, scene units.
  struct Wish {
    glm::dvec3 place{0};
    double spacing = 0;
  };

  /// @param wishes  one or more
  /// @param cell    width of the cells of level 0, scene units, above 0
  SpacingMap(std::span<const Wish> wishes, double cell);

  /// Returns the finest spacing asked for by cells within a ball and half a cell around it; where
  /// they ask for none, by the nearest that do, about.
  [[nodiscard]] double at(const glm::dvec3& centre, double radius) const;

  /// Multiplies all spacings.
  void scale(double factor) noexcept { factor_ *= factor; }

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cell& cell) const noexcept;
  };
  using Level = std::unordered_map<Cell, double, Hash>;

  /// Returns the cell of a point. @param width  of the cells
  static Cell cell_at(const glm::dvec3& point, double width);
  /// Returns the finest spacing within a ball, or infinity.
  [[nodiscard]] double finest(const glm::dvec3& centre, double radius) const;

  double cell_;
  double factor_ = 1;
  std::vector<Level> levels_;  ///< the last has 8 cells at most
};

}  // namespace ptc
