// Points on their way from stage to stage: one pull interface for surfels, one for sorted records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace ptc {

struct PointRecord;
struct Surfel;

/// Surfels in the order of their file, one block after another.
class PointSource {
 public:
  virtual ~PointSource() = default;
  /// Fills the front of `out` with the next surfels.
  /// @return how many; 0 at the end
  /// @throws DataError naming file and offset (binary) or line (text) of the point at fault
  virtual std::size_t next(std::span<Surfel> out) = 0;
};

/// Point records by ascending key, one block after another.
class PointStream {
 public:
  virtual ~PointStream() = default;
  /// Fills the front of `out` with the next records.
  /// @return how many; 0 at the end
  virtual std::size_t next(std::span<PointRecord> out) = 0;
};

}  // namespace ptc
