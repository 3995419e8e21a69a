#include "engine/pipeline/shade/shading_channels.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "engine/io/cloud/point_rows.h"
#include "engine/scene/light/lights.h"

namespace ptc {
namespace {

/// What the names of groups' channels begin with.
constexpr std::string_view kGroupPrefix = "light_";
constexpr std::string_view kShadowPrefix = "shadow_";
constexpr const char* kRadianceUnit = "W/(m^2 sr)";

Channel number(std::string name, const char* unit) {
  return {.name = std::move(name), .unit = unit};
}

Channel colour(std::string name, const char* unit) {
  return {.name = std::move(name),
          .components = 3,
          .role = ChannelRole::colour,
          .colour_space = ColourSpace::rec709,
          .unit = unit};
}

/// Joins columns that begin at `first` to a channel that shading adds, in the type that they have.
/// A channel that is joined already stays as it is. @return whether they are there
bool join_columns(const Channel& added, std::size_t first, std::vector<Channel>& channels) {
  const auto left = std::span<const Channel>(channels).subspan(std::min(first, channels.size()));
  const std::vector<std::string> parts = part_names(added.name, added.components, has_axes(added));
  const bool joined = !left.empty() && left[0].name == added.name && is_shading(left[0]);
  const std::size_t columns = joined ? 1 : parts.size();
  if (left.size() < columns || is_integer(left[0].type) || is_scaled(left[0])) return false;
  for (std::size_t i = 0; i < columns && !joined; ++i) {
    Channel alike = left[0];
    alike.name = parts[i];
    if (left[i] != alike || alike.components != 1) return false;
  }
  Channel whole = added;
  whole.type = left[0].type;
  whole.no_value = left[0].no_value;
  const auto at = channels.begin() + static_cast<std::ptrdiff_t>(first);
  *at = std::move(whole);
  channels.erase(at + 1, at + static_cast<std::ptrdiff_t>(columns));
  return true;
}

/// Says whether a channel is the light of a group. One of another program has no such unit.
bool is_group(const Channel& channel) {
  return channel.name.starts_with(kGroupPrefix) && channel.components == 3 &&
         channel.role == ChannelRole::colour && channel.unit == kRadianceUnit;
}

/// Says whether a channel is the shadow of a group.
bool is_shadow(const Channel& channel) {
  return channel.name.starts_with(kShadowPrefix) && channel.components == 1 && channel.unit == "1";
}

}  // namespace

std::string group_channel(const std::string& group) {
  return std::string(kGroupPrefix) + (group.empty() ? kRestGroup : group);
}

std::string shadow_channel(const std::string& group) {
  return std::string(kShadowPrefix) + group;
}

std::vector<Channel> shading_channels(const ShadedExtras& extras) {
  std::vector<Channel> channels{
      number("occlusion", "1"),
      {.name = "bent_normal", .components = 3, .role = ChannelRole::direction, .unit = "1"},
      colour("irradiance", "W/m^2"),
      colour("sky", "W/m^2"),
      colour("indirect", kRadianceUnit)};
  if (extras.estimates) {
    channels.push_back(number("occlusion_error", "1"));
    channels.push_back(number("irradiance_error", "W/m^2"));
  }
  if (extras.glossy) {
    channels.push_back(colour("reflection", kRadianceUnit));
    channels.push_back(number("reflection_occlusion", "1"));
  }
  for (const std::string& group : extras.shadows)
    channels.push_back(number(shadow_channel(group), "1"));
  for (const std::string& group : extras.groups)
    channels.push_back(colour(group_channel(group), kRadianceUnit));
  return channels;
}

std::size_t later_channels(const ShadedExtras& extras) noexcept {
  return (extras.glossy ? 2 : 0) + extras.shadows.size() + extras.groups.size();
}

bool is_shading(const Channel& channel) {
  if (is_group(channel) || is_shadow(channel)) return true;
  return std::ranges::any_of(
      shading_channels({.estimates = true, .glossy = true}), [&](const Channel& added) {
        return channel.name == added.name && channel.components == added.components;
      });
}

bool have_shading(std::span<const Channel> channels) {
  return std::ranges::all_of(shading_channels({}), [&](const Channel& added) {
    const auto found = std::ranges::find(channels, added.name, &Channel::name);
    return found != channels.end() && is_shading(*found);
  });
}

std::vector<Channel> join_shading(std::vector<Channel> channels) {
  std::vector<Channel> joined = channels;
  const std::vector<Channel> added = shading_channels({.estimates = true, .glossy = true});
  const auto starts = [&](const Channel& channel) { return channel.name == added[0].name; };
  auto at = static_cast<std::size_t>(std::ranges::find_if(joined, starts) - joined.begin());
  for (const Channel& channel : added) {
    if (join_columns(channel, at, joined)) ++at;
  }
  while (at < joined.size() && joined[at].name.starts_with(kShadowPrefix) &&
         join_columns(number(joined[at].name, "1"), at, joined))
    ++at;
  while (at < joined.size() && joined[at].name.starts_with(kGroupPrefix) &&
         joined[at].name.ends_with("_r")) {
    const std::string name = joined[at].name.substr(0, joined[at].name.size() - 2);
    if (!join_columns(colour(name, kRadianceUnit), at, joined)) break;
    ++at;
  }
  return have_shading(joined) ? joined : channels;
}

bool holds_shading(std::span<const Channel> channels, std::uint8_t group) {
  return group == kShadingGroup || std::ranges::all_of(channels, [&](const Channel& channel) {
           return channel.group != group || is_shading(channel);
         });
}

}  // namespace ptc
