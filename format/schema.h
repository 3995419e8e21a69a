// The meta page: which channels the points carry, and what is known about the file
// (spec/points.md#schema).
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace ptc {

enum class ChannelType : std::uint8_t { u8 = 1, u16 = 2, half = 3, f32 = 4 };

/// Bytes of one component.
[[nodiscard]] std::size_t channel_bytes(ChannelType type) noexcept;

/// Greatest number of a group of channels.
inline constexpr std::uint16_t kMaxGroup = 255;

/// A named quantity of every point beyond the core record, e.g. {"occlusion", half, 1, 1}.
struct Channel {
  std::string name;  ///< [a-z0-9_.], 1 to 31 bytes, unique in the file
  ChannelType type = ChannelType::half;
  std::uint8_t components = 1;  ///< 1 to 16
  std::uint16_t group = 1;      ///< attribute pages of this group hold it, 1 to 255
  friend bool operator==(const Channel&, const Channel&) = default;
};

/// Payload of the meta page.
struct Meta {
  std::vector<Channel> channels;            ///< by group, in the order of their columns
  std::map<std::string, std::string> text;  ///< UTF-8 without NUL; keys as channel names
};

/// @throws std::invalid_argument when a name, a text or a channel breaks a rule of the schema, or
///         the channels of one group take more than 34 bytes a point
[[nodiscard]] std::vector<std::byte> encode_meta(const Meta& meta);
/// @throws FormatError when the payload is anything but what encode_meta() gives
[[nodiscard]] Meta decode_meta(std::span<const std::byte> payload);

/// Bytes per point of a group's columns.
[[nodiscard]] std::size_t group_point_bytes(std::span<const Channel> channels, std::uint16_t group);

}  // namespace ptc
