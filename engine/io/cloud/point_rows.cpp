// Numbers in rows of attributes, in whatever type they are, and names that a file can give them.
//
// A name must be free, and so must those of its components, because a file lists only these:
//
//   sky_r, sky x 3  -->  sky_r sky_g sky_b would repeat one  -->  sky_r, sky__r sky__g sky__b
//
// The channel that comes first keeps its name.
#include "engine/io/cloud/point_rows.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <string_view>
#include <utility>

#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/points.h"
#include "format/bytes.h"

namespace ptc {
namespace {

template <typename T>
std::byte* store(T value, std::byte* out) noexcept {
  std::memcpy(out, &value, sizeof value);
  return out + sizeof value;
}

std::size_t longest(const std::vector<std::string>& suffixes) {
  std::size_t bytes = 0;
  for (const std::string& suffix : suffixes) bytes = std::max(bytes, suffix.size());
  return bytes;
}

// Gives a channel the first free name and takes it together with those of its components.
void take_name(RowChannel& row, std::size_t max_bytes, std::set<std::string>& taken) {
  std::string base = row.channel.name;
  std::ranges::replace(base, '.', '_');
  const bool vector = has_axes(row.channel);
  const std::size_t room = max_bytes - longest(part_names("", row.channel.components, vector));
  for (std::size_t extra = 0;; ++extra) {
    row.name = base.substr(0, room - std::min(extra, room)) + std::string(extra, '_');
    row.parts = part_names(row.name, row.channel.components, vector);
    const auto is_taken = [&](const std::string& name) { return taken.contains(name); };
    if (!is_taken(row.name) && std::ranges::none_of(row.parts, is_taken)) break;
  }
  taken.insert(row.name);
  taken.insert(row.parts.begin(), row.parts.end());
}

}  // namespace

std::vector<RowChannel> row_channels(std::span<const Channel> channels, std::set<std::string> taken,
                                     std::size_t max_bytes) {
  std::vector<RowChannel> rows;
  std::size_t offset = 0;
  for (const Channel& channel : channels) {
    RowChannel row{.channel = channel, .offset = offset, .name = {}, .parts = {}};
    offset += channel.bytes();
    if (channel_bytes(channel.type) == 0) continue;  // a type of a later version
    take_name(row, max_bytes, taken);
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<std::string> part_names(const std::string& name, unsigned components, bool vector) {
  if (components == 1) return {name};
  std::vector<std::string> names;
  for (unsigned i = 0; i < components; ++i) {
    std::string part = name + "_";
    if (components == 3) {
      part += (vector ? "xyz" : "rgb")[i];
    } else {
      part += std::to_string(i);
    }
    names.push_back(std::move(part));
  }
  return names;
}

bool is_unknown(const Channel& channel, const std::byte* at) noexcept {
  if (!channel.no_value) return false;
  return std::memcmp(at, &*channel.no_value, channel.component_bytes()) == 0;
}

std::optional<double> meaning_of(const Channel& channel, const std::byte* at) noexcept {
  if (is_unknown(channel, at)) return std::nullopt;
  return load_number(at, channel.type) * channel.scale + channel.offset;
}

bool has_axes(const Channel& channel) noexcept {
  return channel.role == ChannelRole::direction || channel.role == ChannelRole::vector ||
         channel.name.find("normal") != std::string::npos;
}

bool is_integer(ChannelType type) noexcept {
  return type != ChannelType::half && type != ChannelType::f32 && type != ChannelType::f64;
}

bool is_scaled(const Channel& channel) noexcept {
  const bool shown = channel.role == ChannelRole::colour && channel.scale == kByteScale;
  return (channel.scale != 1 && !shown) || channel.offset != 0;
}

std::int64_t load_integer(ChannelType type, const std::byte* at) noexcept {
  switch (type) {
    case ChannelType::u8:
      return load<std::uint8_t>(at, 0);
    case ChannelType::u16:
      return load<std::uint16_t>(at, 0);
    case ChannelType::u32:
      return load<std::uint32_t>(at, 0);
    case ChannelType::u64:
      return static_cast<std::int64_t>(std::min<std::uint64_t>(
          load<std::uint64_t>(at, 0), std::numeric_limits<std::int64_t>::max()));
    case ChannelType::i8:
      return load<std::int8_t>(at, 0);
    case ChannelType::i16:
      return load<std::int16_t>(at, 0);
    case ChannelType::i32:
      return load<std::int32_t>(at, 0);
    case ChannelType::i64:
      return load<std::int64_t>(at, 0);
    default:
      assert(false);
      return 0;
  }
}

std::byte* store_number(ChannelType from, const std::byte* at, ChannelType to,
                        std::byte* out) noexcept {
  if (from == to) {
    const std::size_t bytes = channel_bytes(to);
    std::memcpy(out, at, bytes);
    return out + bytes;
  }
  if (to == ChannelType::i32) {
    constexpr std::int64_t kLow = std::numeric_limits<std::int32_t>::min();
    constexpr std::int64_t kHigh = std::numeric_limits<std::int32_t>::max();
    return store(static_cast<std::int32_t>(std::clamp(load_integer(from, at), kLow, kHigh)), out);
  }
  const double value = load_number(at, from);
  return to == ChannelType::f32 ? store(static_cast<float>(value), out) : store(value, out);
}

}  // namespace ptc
