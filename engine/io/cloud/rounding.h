// What the formats of points round: the positions that become floats, and the values of channels.
//
// A writer asks for it to choose how it holds points and to say what is lost; whoever describes
// points for a writer asks for it to know what must be measured of them.
#pragma once

#include <optional>

#include "engine/base/surfel.h"
#include "engine/io/cloud/point_writer.h"
#include "format/schema.h"

namespace ptc {

/// Returns the bits of the greatest integers of a type, or of the fraction of a floating-point one.
[[nodiscard]] int digits_of(ChannelType type) noexcept;

/// What a file holds of the numbers of a channel, where that may be less than they have.
struct Narrowing {
  std::optional<ChannelType> type;  ///< that of the numbers in the file; without one, they are cut
  double most = 0;                  ///< the greatest magnitude that is kept, if there is no type
};

/// Returns what a file of a format holds of the numbers of a channel; nothing when it holds all of
/// them whatever they are, or when measured_channels() decides.
[[nodiscard]] std::optional<Narrowing> narrowing_of(OutputFormat format, const Channel& channel);
/// Says whether values of a channel may be rounded: it was not measured, or one of them is.
[[nodiscard]] bool may_round(const PointWriteInfo& info, const Channel& channel);

/// Returns the most by which a coordinate within the bounds moves when it is rounded to float.
[[nodiscard]] double float_error(const Bounds& bounds) noexcept;
/// Returns the most by which a coordinate of the points moves when it is rounded to float: as it
/// was measured, else for their bounds.
[[nodiscard]] double float_error(const PointWriteInfo& info) noexcept;
/// Returns a length that no two neighbours should be closer than, for points that cover a surface
/// evenly: the longest side of the bounds over the square root of the count. It is 0 when unknown.
[[nodiscard]] double least_spacing(const PointWriteInfo& info) noexcept;

/// The most by which floats may move a point, in spacings, where a writer can choose other
/// positions.
inline constexpr double kMostMove = 1e-4;

/// Says whether the writer of a format chooses its positions so.
[[nodiscard]] constexpr bool chooses_positions(OutputFormat format) noexcept {
  return format == OutputFormat::pcd || format == OutputFormat::usda ||
         format == OutputFormat::usdc;
}

}  // namespace ptc
