// Internal to the point readers: names of channels, and what is known of a channel by its name.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "format/schema.h"

namespace ptc {

/// Returns a name with its letters in lower case and nothing but letters and digits, so that
/// "GpsTime", "gps_time" and "GPS time" are the same.
[[nodiscard]] std::string bare_name(std::string_view name);

/// Returns the name by which PointLayout knows a number of the surfel other than its position and
/// its colour: "NormalX" is nx. @return nothing for any other name
[[nodiscard]] std::optional<std::string_view> surfel_name(std::string_view name);

/// Replaces the name that a file gives to a channel by one that a channel may have, and sets role
/// and unit of the usual ones: "Classification" is a label, "GpsTime" becomes the time `gps_time`.
/// The prefix "scalar_" of CloudCompare is dropped.
/// @param others  the channels whose names are taken
void name_channel(Channel& channel, std::span<const Channel> others);

}  // namespace ptc
