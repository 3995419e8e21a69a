// The points of a part, sorted range by range in the same memory.
#pragma once

#include <array>
#include <cstddef>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <span>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "engine/sort/external_sort.h"
#include "format/point_record.h"

namespace ptc {

/// The points of some ranges of the curve, sorted range by range: while those of one are handed
/// out, those of the next are read.
/// Memory: twice SortOptions::memory_bytes.
class RangeSorts : public PointStream {
 public:
  /// Adds the points of the next range to a sort. @return  whether there was one
  using Read = std::function<bool(ExternalSorter& sorter)>;

  /// @param options   of each of two sorts; SortOptions::expected is the greatest number of points
  ///                  in a range
  /// @param read      may run in another thread, once at a time
  /// @param executor  must outlive this
  RangeSorts(SortOptions options, Read read, const Executor& executor);

  /// @throws as ExternalSorter and `read`; then in all later calls, too
  std::size_t next(std::span<PointRecord> out) override;

 private:
  void begin_next();
  [[nodiscard]] bool take_next();

  const Read read_;
  const Executor& executor_;
  std::array<std::unique_ptr<ExternalSorter>, 2> sorters_;
  std::size_t turn_ = 0;  ///< which of them reads
  std::unique_ptr<PointStream> stream_;
  std::exception_ptr error_;
  std::future<bool> reading_;  ///< last, so that its end is awaited
};

}  // namespace ptc
