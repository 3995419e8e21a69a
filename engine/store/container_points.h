// The points of a container as a stream of records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/stream.h"
#include "engine/store/point_scan.h"
#include "engine/store/reader.h"
#include "format/point_record.h"

namespace ptc {

/// All points of a container by ascending key. Memory: one page.
class ContainerPoints : public PointStream {
 public:
  /// @param container  must outlive this
  explicit ContainerPoints(const ContainerReader& container)
      : container_(container), scan_(container) {}
  /// @throws FormatError when a page is damaged or its keys precede those of the page before;
  ///         std::system_error
  std::size_t next(std::span<PointRecord> out) override;
  /// Passes over the first points; of their pages only the one on which they end is read.
  /// @param points  at most as many as there are
  /// @pre nothing is read yet
  /// @throws as next()
  void skip(std::uint64_t points);

 private:
  /// Reads the next page. @return false at the end
  bool open_page();
  [[noreturn]] void refuse_order() const;

  const ContainerReader& container_;
  PointScan scan_;
  std::uint32_t at_ = 0;  ///< next point of the page
  MortonKey last_;        ///< of the points handed out
};

}  // namespace ptc
