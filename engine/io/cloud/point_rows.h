// Internal to the point writers: the numbers in rows of attributes, and free names for them.
//
//   a row   | intensity u16 | flow f32 x 3 | time f64 |      packed, little-endian
//           0               2              14         22
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "format/schema.h"

namespace ptc {

/// Where the values of a channel lie in each row, and what a file calls them.
struct RowChannel {
  Channel channel;
  std::size_t offset = 0;          ///< bytes from the start of a row
  std::string name;                ///< free in the file
  std::vector<std::string> parts;  ///< the name of each component, free in the file too

  /// Returns where a component of the channel lies in a row.
  [[nodiscard]] const std::byte* at(const std::byte* row, std::size_t component) const noexcept {
    return row + offset + component * channel.component_bytes();
  }
};

/// Returns the channels whose types this program knows, in their order, with free names.
///
/// A name is that of the channel, with `_` for dots. Components of three are _x _y _z in
/// directions, vectors and names that hold "normal", else _r _g _b; other numbers of them are _0 _1
/// ... A name that is taken gets `_` at its end until it and the names of its components are free.
/// @param taken      names that the file uses otherwise
/// @param max_bytes  the longest name that the format can hold; longer ones are cut
[[nodiscard]] std::vector<RowChannel> row_channels(
    std::span<const Channel> channels, std::set<std::string> taken,
    std::size_t max_bytes = std::numeric_limits<std::size_t>::max());

/// Returns the names of the components of a quantity.
/// @param vector  three components are x, y and z, not r, g and b
[[nodiscard]] std::vector<std::string> part_names(const std::string& name, unsigned components,
                                                  bool vector);

/// Says whether the component at `at` has the value that stands for "not known".
[[nodiscard]] bool is_unknown(const Channel& channel, const std::byte* at) noexcept;

/// Returns what the component at `at` means, with scale and offset; nothing when it is not known.
[[nodiscard]] std::optional<double> meaning_of(const Channel& channel,
                                               const std::byte* at) noexcept;

/// Says whether the components of a channel of three are x, y and z.
[[nodiscard]] bool has_axes(const Channel& channel) noexcept;

/// Says whether a type holds integers.
[[nodiscard]] bool is_integer(ChannelType type) noexcept;

/// Says whether the stored values of a channel are not what they mean: scale and offset apply to
/// them. Bytes of a colour in wider fields count as they are.
[[nodiscard]] bool is_scaled(const Channel& channel) noexcept;

/// Returns the integer that lies at `at`, cut to the range of the result; `type` is an integer one.
[[nodiscard]] std::int64_t load_integer(ChannelType type, const std::byte* at) noexcept;

/// Writes a number in another type, rounded to the nearest or cut to the range of i32.
/// @param to  the type of the number itself, f32, f64 or i32
/// @return the end of what was written
std::byte* store_number(ChannelType from, const std::byte* at, ChannelType to,
                        std::byte* out) noexcept;

}  // namespace ptc
