// Fits a surface to the neighbourhoods of many points at once, one in each lane of a vector.
#pragma once

#include <cstddef>

namespace ptc {

inline constexpr std::size_t kFitLanes = 16;        ///< neighbourhoods that are fitted together
inline constexpr std::size_t kMostNeighbours = 64;  ///< the point itself not counted
/// The number of neighbours that is enough for a clean surface. Of so many or fewer, those on one
/// plane may be enough.
inline constexpr std::size_t kFewNeighbours = 16;

/// Neighbourhoods, one for each lane. Offsets are relative to the point, in units of its reach, the
/// distance of its farthest neighbour.
struct FitBatch {
  alignas(64) float x[kMostNeighbours][kFitLanes];  ///< entries from count on are finite
  alignas(64) float y[kMostNeighbours][kFitLanes];
  alignas(64) float z[kMostNeighbours][kFitLanes];
  alignas(64) float count[kFitLanes];  ///< neighbours of the lane; 0 where there is no point
  std::size_t rows = 0;                ///< the greatest count
};

/// What the neighbourhoods say about their points, one number for each lane. Lengths are in units
/// of the reach.
struct FitLanes {
  alignas(64) float normal[3][kFitLanes];  ///< unit, of either side
  alignas(64) float noise[kFitLanes];      ///< RMS distance of neighbours from the surface
  alignas(64) float broad[3][kFitLanes];   ///< normal of the surface through all neighbours
  alignas(64) float scatter[kFitLanes];    ///< RMS distance of neighbours from it
  alignas(64) float offset[kFitLanes];     ///< from the point along the normal to the surface
  alignas(64) float nearest[kFitLanes];    ///< distance of the nearest neighbour
  alignas(64) float spread[kFitLanes];     ///< spacing, from how widely the neighbours spread
  alignas(64) float flatness[kFitLanes];   ///< 1 for a plane, 0 for a ball
  alignas(64) float width[kFitLanes];      ///< second extent over the first; 0 for a line
  alignas(64) float aside[kFitLanes];      ///< distance of the neighbours' mean, in the plane
  alignas(64) float gap[kFitLanes];  ///< third greatest of the distances to the nearest neighbours
                                     ///< in eight directions; empty directions do not count
  /// Mean of d d^T over the unit directions d to near neighbours in the tangent plane:
  /// xx, yy, zz, yz, zx, xy.
  alignas(64) float directions[6][kFitLanes];
};

/// Fits a quadratic surface to each neighbourhood, by weights that fall with the distance from the
/// surface; where there are few, to the most of them that lie on one plane with the point, if the
/// surface through all has fewer on it. All instruction sets give the same bits.
void fit_surfaces(const FitBatch& batch, FitLanes& out) noexcept;

}  // namespace ptc
