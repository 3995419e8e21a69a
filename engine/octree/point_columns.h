// Surfels decoded into columns of doubles, so that sums over them run at full speed.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "format/node_page.h"
#include "format/point_page.h"
#include "format/point_record.h"

namespace ptc {

/// The values of surfels, decoded once, with one column for each value.
/// Memory: 88 bytes for each point, and 24 more where a point emits light.
class PointColumns {
 public:
  /// The columns, in the order in which they lie in memory.
  enum Column : std::size_t {
    kX,  ///< position, lattice units
    kY,
    kZ,
    kDiscRadius,  ///< radius of the disc, lattice units
    kNormalX,     ///< normal, unit length to float precision
    kNormalY,
    kNormalZ,
    kDiscArea,  ///< 2 radius^2, scene units squared
    kRed,       ///< radiance
    kGreen,
    kBlue,
    kEmittedRed,  ///< emission; only when emits()
    kEmittedGreen,
    kEmittedBlue,
    kColumns
  };

  /// Decodes points, in place of those decoded before.
  /// @param unit  lattice unit in scene units
  void assign(std::span<const PointRecord> points, double unit);
  /// Decodes all points of a page, in place of those decoded before.
  /// @param unit  lattice unit in scene units
  void assign(const PointPage& page, double unit);

  /// Returns the values of a column, one for each point. At least kMaxLanes values can be read from
  /// any of them on; those behind the last point are unspecified.
  [[nodiscard]] const double* column(Column k) const noexcept {
    return values_.data() + k * stride_;
  }

  /// Returns whether a point may emit light; without that there are no columns of emission.
  [[nodiscard]] bool emits() const noexcept { return emits_; }

  /// Lanes of the widest vectors that read columns.
  static constexpr std::size_t kMaxLanes = 8;

 private:
  void make_room(std::size_t points, bool emits);

  std::size_t stride_ = 0;      ///< values from one column to the next: the points and kMaxLanes
  std::vector<double> values_;  ///< column after column
  bool emits_ = false;
};

/// Returns the summary of the points from `begin` up to `end`, with an exact bounding sphere about
/// their mean position and an exact cone about their mean normal. Sums follow the order of the
/// points, so that they are the same on every machine.
/// @pre begin < end
[[nodiscard]] NodeSummary summarise_points(const PointColumns& points, std::size_t begin,
                                           std::size_t end);

/// A point, a plane through it and a direction, from which reach_of() measures.
struct ReachFrom {
  std::array<double, 3> centre{};    ///< lattice units
  std::array<double, 3> normal{};    ///< unit normal of the plane; zero: there is no plane
  std::array<float, 3> direction{};  ///< not zero
};

/// The greatest reach of some discs and their normals.
struct Reach {
  double radius = 0;     ///< greatest distance of a point of a disc from the centre, lattice units
  double thickness = 0;  ///< the same from the plane; 0 without a plane
  double cosine = 1;     ///< smallest cosine of the angle between a normal and the direction
  double greatest = 0;   ///< greatest radius of a disc, lattice units
};

/// Returns how far the points from `begin` up to `end` reach.
/// @pre begin < end
[[nodiscard]] Reach reach_of(const PointColumns& points, std::size_t begin, std::size_t end,
                             const ReachFrom& from);

}  // namespace ptc
