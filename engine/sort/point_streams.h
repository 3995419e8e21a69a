// What any reader of a stream of points needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/stream.h"
#include "format/point_record.h"

namespace ptc {

/// Reads points until `block` is full or the stream ends.
/// @return the number of points read
[[nodiscard]] std::size_t read_full(PointStream& points, std::span<PointRecord> block);

/// Reads and drops the next `count` points of a stream, or all that are left.
void pass_over(PointStream& points, std::uint64_t count);

}  // namespace ptc
