// Conversion of surfels to the records of a container, and back.
#pragma once

#include "engine/base/surfel.h"
#include "format/point_record.h"

namespace ptc {

/// Returns the record of a surfel. Its position is rounded to the lattice of the frame, the normal
/// to 1e-4 rad, radiance and emission to half (at most 65504) and the albedo to 8 bits.
[[nodiscard]] PointRecord to_record(const Surfel& surfel, const Frame& frame) noexcept;
/// Returns the surfel of a record. The position is exact.
[[nodiscard]] Surfel to_surfel(const PointRecord& record, const Frame& frame) noexcept;

}  // namespace ptc
