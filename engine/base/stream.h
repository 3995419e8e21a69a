// The pull interfaces through which points pass from stage to stage: one for surfels as files have
// them, one for sorted records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/surfel.h"

namespace ptc {

struct PointRecord;

/// Where points lie, as far as that is known without reading all of them.
struct Extent {
  /// A box that is said to hold all points, scene units. Points beyond it are possible, but none of
  /// `sample` is.
  Bounds bounds;
  std::vector<glm::dvec3> sample;  ///< positions of points that are spread evenly, scene units
};

/// Yields surfels in the order of their file, one block after another.
class PointSource {
 public:
  virtual ~PointSource() = default;
  /// Fills the front of `out` with the next surfels.
  /// @param out  room for at least one surfel
  /// @return the number of surfels in `out`; 0 at the end
  /// @throws DataError that names the file and the offset (binary) or line (text) of the bad point
  virtual std::size_t next(std::span<Surfel> out) = 0;
  /// Passes over the first surfels without reading all of them.
  /// @param surfels  at most as many as there are
  /// @return false when this source has to read all that it yields: then none is passed over
  /// @pre next() was not called
  /// @throws as next()
  [[nodiscard]] virtual bool skip(std::uint64_t /*surfels*/) { return false; }
  /// Returns the attributes of the surfels that next() returned last: one row for each of them, the
  /// values of all channels of the source in their order, little-endian, without padding. Empty
  /// when the source has no channels. Valid until the next call of next().
  [[nodiscard]] virtual std::span<const std::byte> attributes() const noexcept { return {}; }
  /// Returns where the points lie; nothing when that is not known, or cannot be believed.
  /// @pre next() was not called
  /// @throws DataError as next(); std::system_error
  [[nodiscard]] virtual std::optional<Extent> extent() { return std::nullopt; }
  /// Returns the number of records that next() left out so far because they name no place, such as
  /// the directions of a scan from which no echo came.
  [[nodiscard]] virtual std::uint64_t left_out() const noexcept { return 0; }
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
