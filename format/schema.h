// The meta page: the channels that the points carry, and texts about the file
// (spec/points.md#schema).
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ptc {

/// The type of a channel's numbers; the values are those of the meta page. A later version may
/// have more types, whose values are bytes without a meaning for this program.
enum class ChannelType : std::uint8_t {
  u8 = 1,
  u16 = 2,
  half = 3,
  f32 = 4,
  u32 = 5,
  u64 = 6,
  i8 = 7,
  i16 = 8,
  i32 = 9,
  i64 = 10,
  f64 = 11
};

/// Returns the bytes that one component of this type takes; 0 for a type of a later version.
[[nodiscard]] std::size_t channel_bytes(ChannelType type) noexcept;

/// What the numbers of a channel are; the values are those of the meta page.
enum class ChannelRole : std::uint8_t {
  value = 0,
  colour = 1,
  direction = 2,
  vector = 3,
  label = 4,
  index = 5,
  time = 6
};

/// The space of a colour; the values are those of the meta page.
enum class ColourSpace : std::uint8_t { none = 0, rec709 = 1, srgb = 2, acescg = 3 };

/// The greatest number of a channel group.
inline constexpr std::uint8_t kMaxGroup = 255;

/// A channel: a named quantity that every point has in addition to the core record, such as
/// {"occlusion", f32, 1, 1}. A component stored as v means v scale + offset.
struct Channel {
  std::string name;                      ///< [a-z0-9_.], 1 to 31 bytes, unique in the file
  ChannelType type = ChannelType::half;  ///< type of each component
  std::uint8_t components = 1;           ///< numbers per point, 1 to 16
  std::uint8_t group = 1;                ///< group of attribute pages that hold it, 1 to 255
  ChannelRole role = ChannelRole::value;
  ColourSpace colour_space = ColourSpace::none;
  std::string unit;  ///< of v scale + offset, as in the SI; at most 15 bytes of UTF-8
  std::optional<std::uint64_t> no_value;  ///< bits of a component that stands for "not known"
  double scale = 1;                       ///< finite, not 0
  double offset = 0;                      ///< finite
  std::uint8_t size = 0;  ///< bytes of a component of a type of a later version; else 0
  friend bool operator==(const Channel&, const Channel&) = default;

  /// Returns the bytes of a component.
  [[nodiscard]] std::size_t component_bytes() const noexcept {
    return size == 0 ? channel_bytes(type) : size;
  }
  /// Returns the bytes of all components of a point.
  [[nodiscard]] std::size_t bytes() const noexcept { return component_bytes() * components; }
};

// A row holds what channels say of a point: their values one after another, without padding.

/// Returns the bytes of a row.
[[nodiscard]] std::size_t row_bytes(std::span<const Channel> channels) noexcept;

/// A channel and its place in a row.
struct RowPlace {
  const Channel* channel;
  std::size_t offset;  ///< bytes from the start of the row
};
/// Finds the channel of a name in the rows of some channels. @return nothing when there is none
[[nodiscard]] std::optional<RowPlace> find_in_row(std::span<const Channel> channels,
                                                  std::string_view name) noexcept;

/// The content of the meta page.
struct Meta {
  std::vector<Channel> channels;            ///< by ascending group, in the order of their columns
  std::map<std::string, std::string> text;  ///< UTF-8 without NUL; keys follow the rules of names
};

/// Encodes the payload of the meta page.
/// @param point_bytes  FileHeader::point_bytes, which the channels of one group keep to
/// @throws std::invalid_argument when a name, a text or a channel breaks a rule of the schema
[[nodiscard]] std::vector<std::byte> encode_meta(const Meta& meta, std::size_t point_bytes);
/// Decodes the payload of a meta page.
/// @throws FormatError when the payload is not exactly what encode_meta() writes for some Meta
[[nodiscard]] Meta decode_meta(std::span<const std::byte> payload, std::size_t point_bytes);

/// Returns the groups of channels, ascending.
[[nodiscard]] std::vector<std::uint8_t> channel_groups(std::span<const Channel> channels);
/// Returns the bytes per point that the columns of a channel group take.
[[nodiscard]] std::size_t group_point_bytes(std::span<const Channel> channels, std::uint8_t group);
/// Fills the payload of an attribute page whose values are all unknown (spec/points.md#void-pages).
/// @param payload  a whole number of points of the group
void fill_void(std::span<const Channel> channels, std::uint8_t group, std::span<std::byte> payload);
/// Says whether all values of an attribute page are unknown.
/// @param payload  a whole number of points of the group
[[nodiscard]] bool is_void(std::span<const Channel> channels, std::uint8_t group,
                           std::span<const std::byte> payload);

}  // namespace ptc
