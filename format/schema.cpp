// The meta page (spec/points.md#schema).
//
//   | channels u32 | texts u32 | channel, 88 bytes | ... | text | text | ...
//
//   channel:  | name, 32 bytes | type | components | group | role | colour | flags | size | 0 |
//             0                32     33           34      35     36       37      38     39
//             | unit, 16 bytes | no_value u64 | scale f64 | offset f64 | 0 u64 |
//             40               56             64          72           80
//   text:     | key bytes u32 | value bytes u32 | key | value |
//
// Every Meta has exactly one encoding: channels by ascending group, texts by ascending key. The
// decoder refuses all others. It compares every count and length with what is left of the payload
// before it reads that far.
#include "format/schema.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "format/bytes.h"
#include "format/error.h"
#include "format/text.h"

namespace ptc {
namespace {

// Fields of the payload, of a channel and of a text's head.
namespace field {
constexpr Field<std::uint32_t> kChannels{0};
constexpr Field<std::uint32_t> kTexts{4};
constexpr Field<std::uint8_t> kType{32};
constexpr Field<std::uint8_t> kComponents{33};
constexpr Field<std::uint8_t> kGroup{34};
constexpr Field<std::uint8_t> kRole{35};
constexpr Field<std::uint8_t> kColourSpace{36};
constexpr Field<std::uint8_t> kFlags{37};
constexpr Field<std::uint8_t> kSize{38};
constexpr Field<std::uint8_t> kReserved{39};
constexpr std::size_t kUnitAt = 40;
constexpr Field<std::uint64_t> kNoValue{56};
constexpr Field<double> kScale{64};
constexpr Field<double> kOffset{72};
constexpr Field<std::uint64_t> kReservedEnd{80};
constexpr Field<std::uint32_t> kKeyBytes{0};
constexpr Field<std::uint32_t> kValueBytes{4};
}  // namespace field

constexpr std::size_t kHeadBytes = 8;  // channel count, text count
constexpr std::size_t kChannelBytes = 88;
constexpr std::size_t kNameBytes = 32;
constexpr std::size_t kUnitBytes = 16;
constexpr std::size_t kTextHeadBytes = 8;  // bytes of key, bytes of value
constexpr std::uint8_t kMaxComponents = 16;
constexpr std::uint8_t kHasNoValue = 1;  // flag

// Returns what is wrong with the type, size and role of a channel, or null.
const char* type_fault(const Channel& channel) {
  const std::size_t bytes = channel.component_bytes();
  if (bytes != 1 && bytes != 2 && bytes != 4 && bytes != 8)
    return "channel's size is not 1, 2, 4 or 8";
  const std::size_t known = channel_bytes(channel.type);
  if (known != 0 && known != bytes) return "channel's size is not that of its type";
  if (channel.no_value.value_or(0) >> (8 * bytes - 1) > 1) return "no_value does not fit the type";
  const bool vector = channel.role == ChannelRole::direction || channel.role == ChannelRole::vector;
  if (vector && channel.components != 3) return "a direction or vector does not have 3 components";
  const bool counts = channel.type == ChannelType::u32 || channel.type == ChannelType::u64;
  if (channel.role == ChannelRole::index && (!counts || channel.components != 1))
    return "an index is not one u32 or u64";
  return nullptr;
}

// Returns what is wrong with the channels as a whole or with the last of them, or null.
const char* fault(std::span<const Channel> channels, std::size_t point_bytes) {
  const Channel& last = channels.back();
  if (!is_name(last.name)) return "channel name is not 1 to 31 of a-z 0-9 _ .";
  if (last.components == 0 || last.components > kMaxComponents) return "components is not 1 to 16";
  if (const char* const wrong = type_fault(last)) return wrong;
  if (last.group == 0) return "channel group is not 1 to 255";
  if (last.unit.size() >= kUnitBytes || !is_utf8(last.unit))
    return "channel's unit is not UTF-8 of at most 15 bytes";
  if (!std::isfinite(last.scale) || last.scale == 0 || !std::isfinite(last.offset))
    return "channel's scale or offset is not finite, or its scale is 0";
  const auto earlier = channels.first(channels.size() - 1);
  if (!earlier.empty() && earlier.back().group > last.group)
    return "channels are not by ascending group";
  const auto same = [&](const Channel& c) { return c.name == last.name; };
  if (std::ranges::any_of(earlier, same)) return "two channels have the same name";
  if (group_point_bytes(channels, last.group) > point_bytes)
    return "channels of one group take more bytes a point than a point page";
  return nullptr;
}

// Returns the text at the front of a field that zeros fill up.
std::string_view padded_text(std::span<const std::byte> field, std::size_t at) {
  const std::string_view all = as_text(field);
  const std::string_view text = all.substr(0, all.find('\0'));
  if (all.find_first_not_of('\0', text.size()) != std::string_view::npos)
    throw FormatError(at, "spec/points.md#meta-zero", "bytes after a channel's text are not zero");
  return text;
}

Channel decode_channel(std::span<const std::byte> bytes, std::size_t at) {
  const std::byte* const p = bytes.data();
  Channel channel;
  channel.name = padded_text(bytes.first(kNameBytes), at);
  channel.unit = padded_text(bytes.subspan(field::kUnitAt, kUnitBytes), at + field::kUnitAt);
  channel.type = static_cast<ChannelType>(field::kType.of(p));
  channel.components = field::kComponents.of(p);
  channel.group = field::kGroup.of(p);
  channel.role = static_cast<ChannelRole>(field::kRole.of(p));
  channel.colour_space = static_cast<ColourSpace>(field::kColourSpace.of(p));
  channel.scale = field::kScale.of(p);
  channel.offset = field::kOffset.of(p);
  const auto flags = field::kFlags.of(p);
  const auto no_value = field::kNoValue.of(p);
  if (flags == kHasNoValue) channel.no_value = no_value;
  if (flags > kHasNoValue || (flags == 0 && no_value != 0) || field::kReserved.of(p) != 0 ||
      field::kReservedEnd.of(p) != 0) {
    throw FormatError(at, "spec/points.md#meta-zero",
                      "channel's reserved bytes and bits are not zero");
  }
  const auto size = field::kSize.of(p);
  if (channel_bytes(channel.type) != size) channel.size = size == 0 ? 0xff : size;
  return channel;
}

// Reads a key and its value from the front of `rest`, which is shortened. The views refer to the
// payload.
std::pair<std::string_view, std::string_view> decode_text(std::span<const std::byte>& rest,
                                                          std::size_t at) {
  constexpr char kSize[] = "spec/points.md#meta-size";
  if (rest.size() < kTextHeadBytes) throw FormatError(at, kSize, "meta page is truncated");
  const auto key_bytes = field::kKeyBytes.of(rest.data());
  const auto value_bytes = field::kValueBytes.of(rest.data());
  rest = rest.subspan(kTextHeadBytes);
  if (key_bytes > rest.size() || value_bytes > rest.size() - key_bytes) {
    throw FormatError(at, kSize, "text runs past the end of the meta page");
  }
  const std::string_view key = as_text(rest.first(key_bytes));
  const std::string_view value = as_text(rest.subspan(key_bytes, value_bytes));
  rest = rest.subspan(std::size_t{key_bytes} + value_bytes);
  if (!is_name(key) || !is_utf8(value)) {
    throw FormatError(at, "spec/points.md#meta-text",
                      "a text's key is not a name, or its value is not UTF-8");
  }
  return {key, value};
}

// Says whether a text is a decimal number (spec/points.md#texts).
bool is_decimal(std::string_view text) noexcept {
  const auto digits = [&] {
    const std::size_t count = std::min(text.find_first_not_of("0123456789"), text.size());
    text.remove_prefix(count);
    return count > 0;
  };
  const auto take = [&](std::string_view any) {
    const bool found = !text.empty() && any.find(text.front()) != std::string_view::npos;
    if (found) text.remove_prefix(1);
    return found;
  };
  take("-");
  if (!digits() || (take(".") && !digits())) return false;
  if (!take("e")) return text.empty();
  take("+-");
  return digits() && text.empty();
}

// Says whether a text has the form that its key fixes, if it fixes one (spec/points.md#texts).
bool has_form(std::string_view key, std::string_view value) noexcept {
  if (key == "up") return value == "x" || value == "y" || value == "z";
  if (key == "time") return is_decimal(value);
  if (key != "metres_per_unit") return true;
  const std::string_view digits = value.substr(0, value.find('e'));
  return is_decimal(value) && !value.starts_with('-') &&
         digits.find_first_of("123456789") != std::string_view::npos;
}

void append_text(std::vector<std::byte>& out, std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  out.insert(out.end(), bytes.begin(), bytes.end());
}

/// Calls visit(value, bytes that stand for "not known", their number) for the values of an
/// attribute page until it returns false. @return whether it never does
template <class Byte, class Visit>
bool all_unknown(std::span<const Channel> channels, std::uint8_t group, std::span<Byte> payload,
                 const Visit& visit) {
  const std::size_t points = payload.size() / group_point_bytes(channels, group);
  Byte* value = payload.data();
  for (const Channel& channel : channels) {
    if (channel.group != group) continue;
    const std::size_t bytes = channel.component_bytes();
    const std::uint64_t bits = channel.no_value.value_or(0);
    for (std::size_t i = 0; i < points * channel.components; ++i, value += bytes) {
      if (!visit(value, &bits, bytes)) return false;
    }
  }
  return true;
}

}  // namespace

std::size_t row_bytes(std::span<const Channel> channels) noexcept {
  std::size_t bytes = 0;
  for (const Channel& channel : channels) bytes += channel.bytes();
  return bytes;
}

std::optional<RowPlace> find_in_row(std::span<const Channel> channels,
                                    std::string_view name) noexcept {
  std::size_t offset = 0;
  for (const Channel& channel : channels) {
    if (channel.name == name) return RowPlace{&channel, offset};
    offset += channel.bytes();
  }
  return std::nullopt;
}

std::size_t channel_bytes(ChannelType type) noexcept {
  switch (type) {
    case ChannelType::u8:
    case ChannelType::i8:
      return 1;
    case ChannelType::u16:
    case ChannelType::i16:
    case ChannelType::half:
      return 2;
    case ChannelType::u32:
    case ChannelType::i32:
    case ChannelType::f32:
      return 4;
    case ChannelType::u64:
    case ChannelType::i64:
    case ChannelType::f64:
      return 8;
  }
  return 0;
}

std::vector<std::byte> encode_meta(const Meta& meta, std::size_t point_bytes) {
  // Write the channels.
  std::vector<std::byte> out(kHeadBytes + kChannelBytes * meta.channels.size());
  field::kChannels.put(out.data(), static_cast<std::uint32_t>(meta.channels.size()));
  field::kTexts.put(out.data(), static_cast<std::uint32_t>(meta.text.size()));
  for (std::size_t i = 0; i < meta.channels.size(); ++i) {
    const char* const wrong = fault(std::span(meta.channels).first(i + 1), point_bytes);
    if (wrong != nullptr) throw std::invalid_argument(std::string("encode_meta: ") + wrong);
    const Channel& channel = meta.channels[i];
    std::byte* const p = out.data() + kHeadBytes + kChannelBytes * i;
    std::ranges::copy(std::as_bytes(std::span(channel.name)), p);
    field::kType.put(p, static_cast<std::uint8_t>(channel.type));
    field::kComponents.put(p, channel.components);
    field::kGroup.put(p, channel.group);
    field::kRole.put(p, static_cast<std::uint8_t>(channel.role));
    field::kColourSpace.put(p, static_cast<std::uint8_t>(channel.colour_space));
    field::kFlags.put(p, channel.no_value ? kHasNoValue : std::uint8_t{0});
    field::kSize.put(p, static_cast<std::uint8_t>(channel.component_bytes()));
    std::ranges::copy(std::as_bytes(std::span(channel.unit)), p + field::kUnitAt);
    field::kNoValue.put(p, channel.no_value.value_or(0));
    field::kScale.put(p, channel.scale);
    field::kOffset.put(p, channel.offset);
  }

  // Append the texts.
  for (const auto& [key, value] : meta.text) {
    if (!is_name(key) || !is_utf8(value)) {
      throw std::invalid_argument(
          "encode_meta: a text's key is not a name, or its value is not UTF-8");
    }
    if (!has_form(key, value))
      throw std::invalid_argument("encode_meta: " + key + " has no such form");
    std::array<std::byte, kTextHeadBytes> head;
    field::kKeyBytes.put(head.data(), static_cast<std::uint32_t>(key.size()));
    field::kValueBytes.put(head.data(), static_cast<std::uint32_t>(value.size()));
    out.insert(out.end(), head.begin(), head.end());
    append_text(out, key);
    append_text(out, value);
  }
  return out;
}

Meta decode_meta(std::span<const std::byte> payload, std::size_t point_bytes) {
  constexpr char kSize[] = "spec/points.md#meta-size";
  if (payload.size() < kHeadBytes) {
    throw FormatError(payload.size(), kSize, "meta page is truncated");
  }
  const auto channel_count = field::kChannels.of(payload.data());
  const auto text_count = field::kTexts.of(payload.data());
  std::span<const std::byte> rest = payload.subspan(kHeadBytes);
  if (channel_count > rest.size() / kChannelBytes) {
    throw FormatError(0, kSize, "channels run past the end of the meta page");
  }

  // Read the channels.
  const auto here = [&] { return payload.size() - rest.size(); };
  Meta meta;
  for (std::uint32_t i = 0; i < channel_count; ++i) {
    meta.channels.push_back(decode_channel(rest.first(kChannelBytes), here()));
    if (const char* const wrong = fault(meta.channels, point_bytes)) {
      throw FormatError(here(), "spec/points.md#meta-channel", wrong);
    }
    rest = rest.subspan(kChannelBytes);
  }

  // Read the texts, which must end with the payload.
  for (std::uint32_t i = 0; i < text_count; ++i) {
    const std::size_t at = here();
    const auto [key, value] = decode_text(rest, at);
    if (!meta.text.empty() && meta.text.rbegin()->first >= key) {
      throw FormatError(at, "spec/points.md#meta-text", "the keys of texts are not ascending");
    }
    if (!has_form(key, value)) {
      throw FormatError(at, "spec/points.md#meta-fact",
                        "the text " + std::string(key) + " does not have its form");
    }
    meta.text.emplace_hint(meta.text.end(), key, value);
  }
  if (!rest.empty()) throw FormatError(here(), kSize, "bytes follow the last text");
  return meta;
}

std::vector<std::uint8_t> channel_groups(std::span<const Channel> channels) {
  std::vector<std::uint8_t> groups;
  for (const Channel& channel : channels) {
    if (groups.empty() || groups.back() != channel.group) groups.push_back(channel.group);
  }
  return groups;
}

std::size_t group_point_bytes(std::span<const Channel> channels, std::uint8_t group) {
  std::size_t bytes = 0;
  for (const Channel& channel : channels) {
    if (channel.group == group) bytes += channel.component_bytes() * channel.components;
  }
  return bytes;
}

void fill_void(std::span<const Channel> channels, std::uint8_t group,
               std::span<std::byte> payload) {
  all_unknown(channels, group, payload,
              [](std::byte* value, const void* unknown, std::size_t size) {
                std::memcpy(value, unknown, size);
                return true;
              });
}

bool is_void(std::span<const Channel> channels, std::uint8_t group,
             std::span<const std::byte> payload) {
  return all_unknown(channels, group, payload,
                     [](const std::byte* value, const void* unknown, std::size_t size) {
                       return std::memcmp(value, unknown, size) == 0;
                     });
}

}  // namespace ptc
