#include "engine/io/cloud/las_vlrs.h"

#include <algorithm>
#include <map>
#include <utility>

#include "format/text.h"

namespace ptc {
namespace {

constexpr std::string_view kDigits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

// Decodes base64 (RFC 4648). @return nothing when the text is not base64
std::optional<std::string> decode_base64(std::string_view text) {
  if (text.size() % 4 != 0) return std::nullopt;
  for (int i = 0; i < 2 && text.ends_with('='); ++i) text.remove_suffix(1);
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t bits = 0;
  int held = 0;  // bits that are not in `bytes` yet
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes += static_cast<char>(bits >> held & 0xff);
  }
  return bytes;
}

std::string_view until_zero(std::string_view text) {
  return text.substr(0, text.find('\0'));
}

}  // namespace

std::string encode_vlrs(std::span<const std::byte> records) {
  std::string text;
  text.reserve((records.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < records.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, records.size() - i);
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (k < count ? std::to_integer<std::uint32_t>(records[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k)
      text += k <= count ? kDigits[bits >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::optional<std::vector<Vlr>> decode_vlrs(std::string_view text) {
  const std::optional<std::string> decoded = decode_base64(text);
  if (!decoded) return std::nullopt;
  std::vector<Vlr> records;
  for (std::string_view rest = *decoded; !rest.empty();) {
    if (rest.size() < kVlrHeaderBytes) return std::nullopt;
    const auto number = [&](std::size_t at) {
      return static_cast<unsigned>(static_cast<unsigned char>(rest[at])) |
             static_cast<unsigned>(static_cast<unsigned char>(rest[at + 1])) << 8;
    };
    const std::size_t bytes = kVlrHeaderBytes + number(20);
    if (bytes > rest.size()) return std::nullopt;
    records.push_back({.user = std::string(until_zero(rest.substr(2, 16))),
                       .number = number(18),
                       .bytes = std::string(rest.substr(0, bytes))});
    rest.remove_prefix(bytes);
  }
  return records;
}

void note_lost_vlrs(std::span<const LostVlr> lost, const std::string& why,
                    std::vector<std::string>& notes) {
  constexpr std::size_t kMostNamed = 8;
  std::map<std::pair<std::string, unsigned>, std::pair<std::size_t, std::uint64_t>> kinds;
  for (const LostVlr& record : lost) {
    auto& [count, bytes] = kinds[{record.user, record.number}];
    ++count;
    bytes += record.bytes;
  }
  std::size_t named = 0;
  for (const auto& [kind, sum] : kinds) {
    if (named++ == kMostNamed) {
      notes.push_back("Records of " + std::to_string(kinds.size() - kMostNamed) +
                      " more kinds are left out.");
      break;
    }
    const auto& [count, bytes] = sum;
    const std::string what =
        std::to_string(kind.second) + " of the user '" + printable(kind.first) + "', ";
    const std::string size = std::to_string(bytes) + " bytes";
    notes.push_back((count == 1
                         ? "The record " + what + size + ", is"
                         : std::to_string(count) + " records " + what + size + " in all, are") +
                    " left out: " + why + ".");
  }
}

ShortVlrs shorten_vlrs(const std::string& text, std::size_t most, const std::string& why) {
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  if (text.size() / 4 * 3 <= most + padding) return {.text = text, .notes = {}};
  const std::optional<std::vector<Vlr>> records = decode_vlrs(text);
  if (!records) {
    return {.text = {}, .notes = {"The text las.vlrs is damaged: its records are left out."}};
  }
  std::string kept;
  std::vector<LostVlr> lost;
  for (const Vlr& record : *records) {
    if (record.bytes.size() <= most - kept.size()) {
      kept += record.bytes;
    } else {
      lost.push_back({record.user, record.number, record.bytes.size() - kVlrHeaderBytes});
    }
  }
  ShortVlrs shorter{.text = encode_vlrs(std::as_bytes(std::span(kept))), .notes = {}};
  note_lost_vlrs(lost, why, shorter.notes);
  return shorter;
}

}  // namespace ptc
