#include "engine/io/cloud/display_colour.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include <glm/common.hpp>

#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/points.h"
#include "engine/io/cloud/srgb_curve.h"
#include "engine/io/image/srgb.h"

namespace ptc {
namespace {

// Returns the channel of this name, if this program knows its type.
std::optional<RowChannel> find_channel(const PointWriteInfo& info, std::string_view name) {
  for (const RowChannel& row : row_channels(info.channels, {})) {
    if (row.channel.name == name) return row;
  }
  return std::nullopt;
}

bool is_stored_colour(const Channel& channel) {
  const bool whole = channel.scale == 1;  // white is the greatest value of the type
  return channel.components == 3 && channel.colour_space == ColourSpace::srgb &&
         ((channel.type == ChannelType::u8 && whole) ||
          (channel.type == ChannelType::u16 && (whole || channel.scale == kByteScale))) &&
         channel.offset == 0;
}

// Returns a number in [0, 1]; what is no number becomes 0.
float to_share(double value) {
  return static_cast<float>(value > 0 ? std::min(value, 1.0) : 0.0);
}

// Returns a colour on the sRGB curve, `white` for 1.
std::array<std::uint16_t, 3> to_srgb(const glm::vec3& light, double white) {
  const auto number = [white](float linear) {
    const auto share = static_cast<double>(to_share(static_cast<double>(linear)));
    return static_cast<std::uint16_t>(std::lround(white * linear_to_srgb(share)));
  };
  return {number(light.r), number(light.g), number(light.b)};
}

// Returns a share of 65535 as one of 255, to the nearest.
std::uint8_t to_byte(std::uint16_t wide) {
  return static_cast<std::uint8_t>((wide * 255U + 32767) / 65535);
}

}  // namespace

DisplayColour::DisplayColour(const PointWriteInfo& info)
    : chosen_(!info.colour_from.empty()),
      surfels_have_albedo_(info.has_albedo),
      bytes_stay_(info.text.contains("las.header")) {
  if (info.has_albedo) kind_ = Kind::albedo;
  source_ = find_channel(info, chosen_ ? info.colour_from : "rgb");
  if (!source_) return;
  if (is_stored_colour(source_->channel)) {
    kind_ = Kind::stored;
  } else if (chosen_) {
    kind_ = Kind::shown;
  }
}

glm::vec3 DisplayColour::linear(const Surfel& surfel, const std::byte* row) const {
  if (kind_ == Kind::shown) return shown_light(row);
  return shows_stored(surfel, row) ? stored_light(row) : surfel.albedo;
}

std::array<std::uint16_t, 3> DisplayColour::srgb(const Surfel& surfel, const std::byte* row) const {
  return to_srgb(linear(surfel, row), 65535);
}

std::array<std::uint8_t, 3> DisplayColour::bytes(const Surfel& surfel, const std::byte* row) const {
  std::array<std::uint8_t, 3> bytes{};
  if (shows_stored(surfel, row)) {
    const std::array<std::uint16_t, 3> stored = stored_integers(row);
    for (std::size_t i = 0; i < 3; ++i)
      bytes[i] = stores_bytes() ? static_cast<std::uint8_t>(stored[i]) : to_byte(stored[i]);
    return bytes;
  }
  std::ranges::transform(to_srgb(linear(surfel, row), 65535), bytes.begin(), to_byte);
  return bytes;
}

std::vector<RowChannel> DisplayColour::without_bytes(std::vector<RowChannel> channels) const {
  return kind_ == Kind::stored && stores_bytes() ? without_stored(std::move(channels)) : channels;
}

std::vector<RowChannel> DisplayColour::without_stored(std::vector<RowChannel> channels) const {
  if (kind_ == Kind::stored)
    std::erase_if(channels, [&](const RowChannel& c) { return c.offset == source_->offset; });
  return channels;
}

bool DisplayColour::is_recoloured(const Surfel& surfel, const std::byte* row) const {
  return kind_ == Kind::stored && knows(row) && !shows_stored(surfel, row);
}

bool DisplayColour::stores_bytes() const noexcept {
  return source_->channel.type == ChannelType::u8 || source_->channel.scale == kByteScale;
}

bool DisplayColour::shows_stored(const Surfel& surfel, const std::byte* row) const {
  constexpr float kRounding = 0.003F;  // of an albedo in a container
  if (kind_ != Kind::stored || !knows(row)) return false;
  if (chosen_ || !surfels_have_albedo_) return true;
  const glm::vec3 apart = glm::abs(stored_light(row) - surfel.albedo);
  return std::max({apart.r, apart.g, apart.b}) <= kRounding;
}

std::array<std::uint16_t, 3> DisplayColour::stored_integers(const std::byte* row) const {
  const std::int64_t white = stores_bytes() ? 255 : 65535;
  std::array<std::uint16_t, 3> values{};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int64_t value = load_integer(source_->channel.type, source_->at(row, i));
    values[i] = static_cast<std::uint16_t>(std::min(value, white));
  }
  return values;
}

glm::vec3 DisplayColour::stored_light(const std::byte* row) const {
  const std::array<std::uint16_t, 3> values = stored_integers(row);
  glm::vec3 light;
  for (std::size_t i = 0; i < 3; ++i) {
    light[static_cast<int>(i)] =
        stores_bytes() ? srgb_curve<255>()[values[i]] : srgb_curve<65535>()[values[i]];
  }
  return light;
}

bool DisplayColour::knows(const std::byte* row) const noexcept {
  return !is_unknown(source_->channel, source_->at(row, 0));
}

std::array<std::uint16_t, 3> DisplayColour::stored_values(const Surfel& surfel,
                                                          const std::byte* row) const {
  if (!knows(row)) return to_srgb(surfel.albedo, stored_white());
  const int factor = static_cast<int>(stored_white()) / (stores_bytes() ? 255 : 65535);
  std::array<std::uint16_t, 3> values = stored_integers(row);
  for (std::uint16_t& value : values) value = static_cast<std::uint16_t>(factor * value);
  return values;
}

double DisplayColour::stored_white() const noexcept {
  return bytes_stay_ && source_->channel.scale == kByteScale ? 255 : 65535;
}

glm::vec3 DisplayColour::shown_light(const std::byte* row) const {
  const Channel& channel = source_->channel;
  const auto number = [&](std::size_t i) {
    return channel.scale * load_number(source_->at(row, i), channel.type) + channel.offset;
  };
  if (channel.components == 1) {
    const bool covers = channel.name == "occlusion";
    return glm::vec3(to_share(covers ? 1 - number(0) : number(0)));
  }
  const glm::dvec3 light(number(0), number(1), number(2));
  if (channel.colour_space == ColourSpace::srgb) {  // of a surface, with a scale: white is 1
    const auto linear = [](double value) {
      return static_cast<float>(srgb_to_linear(static_cast<double>(to_share(value))));
    };
    return {linear(light.r), linear(light.g), linear(light.b)};
  }
  const double luminance = 0.2126 * light.r + 0.7152 * light.g + 0.0722 * light.b;  // Rec. 709
  const double factor = luminance > 0 ? 1 / (1 + luminance) : 1;
  return {to_share(factor * light.r), to_share(factor * light.g), to_share(factor * light.b)};
}

}  // namespace ptc
