// Merges the surfels of cells that are flat and evenly lit, so that a wall takes no more of them
// than it needs.
//
//   o o | o o        O       Four cells of a wall become one surfel, and four of these another one.
//   o o | o o   ->       O   A cell that bends, that an edge of light crosses, or that the surface
//   ----+----   ->   O       fills unevenly keeps its surfels.
//   o o | o o            O
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "engine/base/stream.h"

namespace ptc {

/// How much the surfels of a cell may differ to become one. The first three are root mean squares
/// over them, by area.
struct Flatness {
  double height = 0;    ///< distance from their mean plane, over their mean radius
  double turn = 0;      ///< angle between their normals and the mean normal [rad]
  double contrast = 0;  ///< deviation of each of their colours, over the brightest mean channel
  double growth = 1;    ///< greatest radius of the merged surfel over their mean radius
  double reach = 1;     ///< greatest distance of their rims from its centre, over its radius
};

/// What merge_flat_cells() has done.
struct MergeCounts {
  std::uint64_t points = 0;  ///< surfels that came
  std::uint64_t merged = 0;  ///< of them, those that became part of another one
  std::uint64_t made = 0;    ///< surfels that stand for several
  /// Sums by area: of the squares of what leaves the surfels that came, and of their albedo, and of
  /// the squares by which the surfels that stand for them differ.
  double light_square = 0, light_change = 0, albedo_square = 0, albedo_change = 0;

  MergeCounts& operator+=(const MergeCounts& other) noexcept;
  /// Returns the root mean square change of what leaves surfels, as a share of that of the light.
  [[nodiscard]] double light_error() const noexcept;
  /// Returns the same of their albedo.
  [[nodiscard]] double albedo_error() const noexcept;
};

/// Says whether the surface goes on up to the rim of a surfel that would stand for others.
/// @param finest  mean radius of those, scene units
using SurfaceGoesOn = std::function<bool(const PointRecord& disc, float finest)>;

/// Returns a stream in which one surfel stands for all of a cell of the octree where these are as
/// `most` allows and the surface goes on up to its rim. It lies at their mean position, with their
/// mean normal and mean colours, by area, and the area that they cover along that normal. Surfels
/// of radius 0, and several at one place, stay as they are.
/// @param sorted, goes_on  must outlive the result, and what `goes_on` refers to, too
/// @param unit             lattice unit in scene units
/// @param counts           is kept up to date as the result is read; must outlive it
[[nodiscard]] std::unique_ptr<PointStream> merge_flat_cells(PointStream& sorted, double unit,
                                                            const Flatness& most,
                                                            const SurfaceGoesOn& goes_on,
                                                            MergeCounts& counts);

}  // namespace ptc
