// The channels that shading adds, and how those of an earlier shading are known again.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "format/schema.h"

namespace ptc {

/// The group of the channels that shading adds.
inline constexpr std::uint8_t kShadingGroup = 1;

/// What a shading adds to a point besides its light.
struct ShadedExtras {
  bool estimates = false;            ///< estimated errors
  bool glossy = false;               ///< reflections
  std::vector<std::string> shadows;  ///< names of groups of lights whose shadows come along
  std::vector<std::string> groups;   ///< names of groups of lights; empty: the rest
};

/// Returns the name of the channel or layer of a group of lights.
/// @param group  empty: the rest
[[nodiscard]] std::string group_channel(const std::string& group);

/// Returns the name of the channel or layer of the shadow of a group of lights.
[[nodiscard]] std::string shadow_channel(const std::string& group);

/// Returns the channels that shading adds to a point, of type half: those of kShadingGroup, then
/// those of later_channels().
[[nodiscard]] std::vector<Channel> shading_channels(const ShadedExtras& extras);

/// Returns the number of the last shading_channels() whose groups the container chooses: those of
/// reflections and shadows, and one for each group of lights.
[[nodiscard]] std::size_t later_channels(const ShadedExtras& extras) noexcept;

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
