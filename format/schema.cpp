// The meta page (spec/points.md#schema).
//
//   | channels u32 | texts u32 | channel, 40 bytes | ... | text | text | ...
//
//   channel:  | name, 32 bytes with zeros | type | components | group u16 | 0 u32 |
//   text:     | key bytes u32 | value bytes u32 | key | value |
//
// Every Meta has exactly one encoding: channels by ascending group, texts by ascending key. The
// decoder refuses all others. It compares every count and length with what is left of the payload
// before it reads that far.
#include "format/schema.h"

#include <algorithm>
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
constexpr Field<std::uint16_t> kGroup{34};
constexpr Field<std::uint32_t> kReserved{36};
constexpr Field<std::uint32_t> kKeyBytes{0};
constexpr Field<std::uint32_t> kValueBytes{4};
}  // namespace field

constexpr std::size_t kHeadBytes = 8;      // channel count, text count
constexpr std::size_t kChannelBytes = 40;  // name[32], type, components, group, 0
constexpr std::size_t kNameBytes = 32;
constexpr std::size_t kTextHeadBytes = 8;   // bytes of key, bytes of value
constexpr std::size_t kMaxGroupBytes = 34;  // as in a core record, so that the page always fits
constexpr std::uint8_t kMaxComponents = 16;

bool known(ChannelType type) noexcept {
  return type >= ChannelType::u8 && type <= ChannelType::f32;
}

// Returns what is wrong with the channels as a whole or with the last of them, or null.
const char* fault(std::span<const Channel> channels) {
  const Channel& last = channels.back();
  if (!is_name(last.name)) return "channel name is not 1 to 31 of a-z 0-9 _ .";
  if (!known(last.type)) return "unknown channel type";
  if (last.components == 0 || last.components > kMaxComponents) return "components is not 1 to 16";
  if (last.group == 0 || last.group > kMaxGroup) return "channel group is not 1 to 255";
  const auto earlier = channels.first(channels.size() - 1);
  if (!earlier.empty() && earlier.back().group > last.group)
    return "channels are not by ascending group";
  const auto same = [&](const Channel& c) { return c.name == last.name; };
  if (std::ranges::any_of(earlier, same)) return "two channels have the same name";
  if (group_point_bytes(channels, last.group) > kMaxGroupBytes) {
    return "channels of one group take more than 34 bytes a point";
  }
  return nullptr;
}

Channel decode_channel(std::span<const std::byte> bytes, std::size_t at) {
  const std::string_view field = as_text(bytes.first(kNameBytes));
  Channel channel;
  channel.name = field.substr(0, field.find('\0'));
  channel.type = static_cast<ChannelType>(field::kType.of(bytes.data()));
  channel.components = field::kComponents.of(bytes.data());
  channel.group = field::kGroup.of(bytes.data());
  const bool padded = field.find_first_not_of('\0', channel.name.size()) == std::string_view::npos;
  if (!padded || field::kReserved.of(bytes.data()) != 0) {
    throw FormatError(at, "spec/points.md#meta-zero", "channel's reserved bytes are not zero");
  }
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

void append_text(std::vector<std::byte>& out, std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  out.insert(out.end(), bytes.begin(), bytes.end());
}

}  // namespace

std::size_t channel_bytes(ChannelType type) noexcept {
  return type == ChannelType::u8 ? 1 : type == ChannelType::f32 ? 4 : 2;
}

std::vector<std::byte> encode_meta(const Meta& meta) {
  // Write the channels.
  std::vector<std::byte> out(kHeadBytes + kChannelBytes * meta.channels.size());
  field::kChannels.put(out.data(), static_cast<std::uint32_t>(meta.channels.size()));
  field::kTexts.put(out.data(), static_cast<std::uint32_t>(meta.text.size()));
  for (std::size_t i = 0; i < meta.channels.size(); ++i) {
    const char* const wrong = fault(std::span(meta.channels).first(i + 1));
    if (wrong != nullptr) throw std::invalid_argument(std::string("encode_meta: ") + wrong);
    const Channel& channel = meta.channels[i];
    std::byte* const p = out.data() + kHeadBytes + kChannelBytes * i;
    std::ranges::copy(std::as_bytes(std::span(channel.name)), p);
    field::kType.put(p, static_cast<std::uint8_t>(channel.type));
    field::kComponents.put(p, channel.components);
    field::kGroup.put(p, channel.group);
  }

  // Append the texts.
  for (const auto& [key, value] : meta.text) {
    if (!is_name(key) || !is_utf8(value)) {
      throw std::invalid_argument(
          "encode_meta: a text's key is not a name, or its value is not UTF-8");
    }
    std::array<std::byte, kTextHeadBytes> head;
    field::kKeyBytes.put(head.data(), static_cast<std::uint32_t>(key.size()));
    field::kValueBytes.put(head.data(), static_cast<std::uint32_t>(value.size()));
    out.insert(out.end(), head.begin(), head.end());
    append_text(out, key);
    append_text(out, value);
  }
  return out;
}

Meta decode_meta(std::span<const std::byte> payload) {
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
    if (const char* const wrong = fault(meta.channels)) {
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
    meta.text.emplace_hint(meta.text.end(), key, value);
  }
  if (!rest.empty()) throw FormatError(here(), kSize, "bytes follow the last text");
  return meta;
}

std::size_t group_point_bytes(std::span<const Channel> channels, std::uint16_t group) {
  std::size_t bytes = 0;
  for (const Channel& channel : channels) {
    if (channel.group == group) bytes += channel_bytes(channel.type) * channel.components;
  }
  return bytes;
}

}  // namespace ptc
