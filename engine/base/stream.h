// The pull interfaces through which points pass from stage to stage: one for surfels as files have
// them, one for sorted records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace ptc {

struct PointRecord;
struct Surfel;

/// Yields surfels in the order of their file, one block after another.
class PointSource {
 public:
  virtual ~PointSource() = default;
  /// Fills the front of `out` with the next surfels.
  /// @param out  room for at least one surfel
  /// @return the number of surfels in `out`; 0 at the end
  /// @throws DataError that names the file and the offset (binary) or line (text) of the bad point
  virtual std::size_t next(std::span<Surfel> out) = 0;
};

/// Yields point records by ascending key, one block after another.
class PointStream {
 public:
  virtual ~PointStream() = default;
  /// Fills the front of `out` with the next records.
  /// @param out  room for at least one record
  /// @return the number of records in `out`; 0 at the end
  virtual std::size_t next(std::span<PointRecord> out) = 0;
};

}  // namespace ptc
