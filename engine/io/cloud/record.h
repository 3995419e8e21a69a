// Surfels to the records of the file, and back.
#pragma once

#include "engine/base/surfel.h"
#include "format/point_record.h"

namespace ptc {

/// Rounds a surfel to what the file keeps: position to the lattice, normal to 1e-4 rad, radiance to
/// half (saturating at 65504), albedo to 8 bits.
[[nodiscard]] PointRecord to_record(const Surfel& surfel, const Frame& frame) noexcept;
[[nodiscard]] Surfel to_surfel(const PointRecord& record, const Frame& frame) noexcept;

}  // namespace ptc
