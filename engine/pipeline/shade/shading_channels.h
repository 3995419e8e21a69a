// The channels that shading adds, and how those of an earlier shading are known again.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "format/schema.h"

namespace ptc {

/// The group of the channels that shading adds.
inline constexpr std::uint8_t kShadingGroup = 1;

/// Returns the channels that shading adds to a point, all of kShadingGroup and of type half.
[[nodiscard]] std::vector<Channel> shading_channels(bool estimates);

/// Says whether a channel has the name and the components of one that shading adds.
[[nodiscard]] bool is_shading(const Channel& channel);

/// Says whether channels have all that shading adds, but for the estimates: such a set comes from
/// an earlier shading, while a channel that has the name of one may be of anyone.
[[nodiscard]] bool have_shading(std::span<const Channel> channels);

/// Joins the columns that shading writes to a file of points, such as sky_r sky_g sky_b, to the
/// channels that they were. Rows stay as they are.
/// @return the channels as they are where not all columns of a shading follow one another
[[nodiscard]] std::vector<Channel> join_shading(std::vector<Channel> channels);

/// Says whether a group holds an earlier shading, which the next one replaces.
[[nodiscard]] bool holds_shading(std::span<const Channel> channels, std::uint8_t group);

}  // namespace ptc
