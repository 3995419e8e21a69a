// Surfels in columns of numbers, as sums over them want them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// The numbers of surfels, decoded once; in lattice units where nothing else is said.   Memory: 88
/// bytes a point.
class PointColumns {
 public:
  enum Column : std::size_t {
    kX,
    kY,
    kZ,
    kDiscRadius,
    kNormalX,
    kNormalY,
    kNormalZ,
    kDiscArea,
    kRed,
    kGreen,
    kBlue,
    kColumns
  };

  /// Decodes points in place of what was here.
  /// @param unit  lattice unit in scene units
  void assign(std::span<const PointRecord> points, double unit);

  /// Values of a column. The area is 2 radius^2 in scene units squared. At least kMaxLanes values
  /// can be read from each.
  [[nodiscard]] const double* column(Column k) const noexcept {
    return values_.data() + k * stride_;
  }

  /// Lanes of the widest vectors that read columns.
  static constexpr std::size_t kMaxLanes = 8;

 private:
  std::size_t stride_ = 0;
  std::vector<double> values_;
};

/// Summary of the points from `begin` to `end`, at least one: exact bounding sphere and cone. Sums
/// run in the order of the points, so that they are the same on every machine.
[[nodiscard]] NodeSummary summarise_points(const PointColumns& points, std::size_t begin,
                                           std::size_t end);

}  // namespace ptc
