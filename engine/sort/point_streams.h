// What any reader of a stream of points needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/base/stream.h"
#include "format/point_record.h"

namespace ptc {

/// Reads points until `block` is full or the stream ends.
/// @return the number of points read
[[nodiscard]] std::size_t read_full(PointStream& points, std::span<PointRecord> block);

/// Reads and drops the next `count` points of a stream, or all that are left.
void pass_over(PointStream& points, std::uint64_t count);

/// Reads the next points of a stream on a thread of its own, while the caller works on those
/// before. Memory: two blocks of 2^14 records.
/// @param points  must outlive the returned stream, and is read by it alone
[[nodiscard]] std::unique_ptr<PointStream> read_ahead(PointStream& points);

}  // namespace ptc
