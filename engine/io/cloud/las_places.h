// Internal to the LAS writer: which channels fill the standard places of a point record, and how.
//
// Source: ASPRS LAS 1.4 R15, table 15 (point data record format 6).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"

namespace ptc::las {

/// The places of a point record that a channel can fill.
enum class Field : std::uint8_t {
  intensity,
  return_number,
  number_of_returns,
  class_flags,
  scanner_channel,
  scan_direction,
  edge_of_flight_line,
  classification,
  user_data,
  scan_angle,
  point_source_id,
  gps_time,
  nir
};

/// A channel that fills a place of the point record. A value v becomes v factor + shift, rounded
/// and cut to the range of the place, unless the place holds doubles.
struct PlacedChannel {
  Field field{};
  RowChannel channel;
  double factor = 1;
  double shift = 0;
  double low = 0;    ///< the least value of the place
  double high = 0;   ///< the greatest one
  std::string loss;  ///< what is not kept of the values, a sentence; empty when all is
  /// The values that were measured chose factor and shift, so another file may get others.
  bool by_values = false;

  /// Returns the value of the place for a point of which it is known; 0 for NaN.
  [[nodiscard]] double value(const std::byte* row) const noexcept;
};

/// Returns the names of all places.
[[nodiscard]] std::vector<std::string_view> place_names();

/// Says whether a channel has the name of a place, but must be measured before it can fill it.
[[nodiscard]] bool needs_range(const Channel& channel);

/// Returns the greatest value of the place that a channel fills without being measured, if its type
/// has greater ones, which are cut; nothing for any other channel.
[[nodiscard]] std::optional<double> cut_above(const Channel& channel);

/// Finds the place of a channel: by its name, if its type fits there or all values that were
/// measured do. An intensity always fits, because it is scaled.
/// @param ranges  PointWriteInfo::ranges
[[nodiscard]] std::optional<PlacedChannel> place_channel(
    const RowChannel& channel, const std::map<std::string, ValueRange>& ranges);

/// Returns a sentence about a channel that was measured and does not fit the place of its name;
/// empty for any other channel. @pre place_channel() found no place
[[nodiscard]] std::string misfit(const RowChannel& channel,
                                 const std::map<std::string, ValueRange>& ranges);

}  // namespace ptc::las
