// The meta page: the channels that the points carry, and texts about the file
// (spec/points.md#schema).
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace ptc {

/// The type of a channel's numbers; the values are those of the meta page.
enum class ChannelType : std::uint8_t { u8 = 1, u16 = 2, half = 3, f32 = 4 };

/// Returns the bytes that one component of this type takes.
[[nodiscard]] std::size_t channel_bytes(ChannelType type) noexcept;

/// The greatest number of a channel group.
inline constexpr std::uint16_t kMaxGroup = 255;

/// A channel: a named quantity that every point has in addition to the core record, such as
/// {"occlusion", half, 1, 1}.
struct Channel {
  std::string name;                      ///< [a-z0-9_.], 1 to 31 bytes, unique in the file
  ChannelType type = ChannelType::half;  ///< type of each component
  std::uint8_t components = 1;           ///< numbers per point, 1 to 16
  std::uint16_t group = 1;               ///< group of attribute pages that hold it, 1 to 255
  friend bool operator==(const Channel&, const Channel&) = default;
};

/// The content of the meta page.
struct Meta {
  std::vector<Channel> channels;            ///< by ascending group, in the order of their columns
  std::map<std::string, std::string> text;  ///< UTF-8 without NUL; keys follow the rules of names
};

/// Encodes the payload of the meta page.
/// @throws std::invalid_argument when a name, a text or a channel breaks a rule of the schema, or
///         the channels of one group take more than 34 bytes a point
[[nodiscard]] std::vector<std::byte> encode_meta(const Meta& meta);
/// Decodes the payload of a meta page.
/// @throws FormatError when the payload is not exactly what encode_meta() writes for some Meta
[[nodiscard]] Meta decode_meta(std::span<const std::byte> payload);

/// Returns the bytes per point that the columns of a channel group take.
[[nodiscard]] std::size_t group_point_bytes(std::span<const Channel> channels, std::uint16_t group);

}  // namespace ptc
