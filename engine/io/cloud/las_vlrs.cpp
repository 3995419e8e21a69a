#include "engine/io/cloud/las_vlrs.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <utility>

#include "format/text.h"

namespace ptc {
namespace {

constexpr std::string_view kDigits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr char kExtendedMark = ',';  // stands before extended records

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

std::string encode_base64(std::span<const std::byte> records) {
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

// Returns how many bytes base64 text stands for.
std::size_t decoded_bytes(std::string_view text) {
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  return text.size() / 4 * 3 - std::min(padding, text.size() / 4 * 3);
}

// Returns the two parts of a text: plain records and extended ones.
std::pair<std::string_view, std::string_view> split(std::string_view text) {
  const std::size_t comma = text.find(kExtendedMark);
  if (comma == std::string_view::npos) return {text, {}};
  return {text.substr(0, comma), text.substr(comma + 1)};
}

// Appends the records of one part of a text. @return whether the part is sound
bool decode_part(std::string_view text, bool extended, std::vector<Vlr>& records) {
  const std::optional<std::string> decoded = decode_base64(text);
  if (!decoded) return false;
  const std::size_t header_bytes = extended ? kEvlrHeaderBytes : kVlrHeaderBytes;
  for (std::string_view rest = *decoded; !rest.empty();) {
    if (rest.size() < header_bytes) return false;
    std::uint16_t number = 0;
    std::uint64_t payload = 0;
    std::memcpy(&number, rest.data() + 18, sizeof number);
    std::memcpy(&payload, rest.data() + 20, extended ? 8 : 2);
    if (payload > rest.size() - header_bytes) return false;
    const std::size_t bytes = header_bytes + static_cast<std::size_t>(payload);
    records.push_back({.user = std::string(until_zero(rest.substr(2, 16))),
                       .number = number,
                       .bytes = std::string(rest.substr(0, bytes)),
                       .extended = extended});
    rest.remove_prefix(bytes);
  }
  return true;
}

}  // namespace

std::string encode_vlrs(std::span<const std::byte> records, std::span<const std::byte> extended) {
  std::string text = encode_base64(records);
  if (!extended.empty()) text += kExtendedMark + encode_base64(extended);
  return text;
}

std::optional<std::vector<Vlr>> decode_vlrs(std::string_view text) {
  const auto [plain, extended] = split(text);
  std::vector<Vlr> records;
  if (!decode_part(plain, false, records) || !decode_part(extended, true, records))
    return std::nullopt;
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
  const auto [plain, extended] = split(text);
  if (decoded_bytes(plain) + decoded_bytes(extended) <= most) return {.text = text, .notes = {}};
  const std::optional<std::vector<Vlr>> records = decode_vlrs(text);
  if (!records) {
    return {.text = {}, .notes = {"The text las.vlrs is damaged: its records are left out."}};
  }
  std::string kept, kept_extended;
  std::vector<LostVlr> lost;
  for (const Vlr& record : *records) {
    if (record.bytes.size() <= most - kept.size() - kept_extended.size()) {
      (record.extended ? kept_extended : kept) += record.bytes;
    } else {
      lost.push_back({record.user, record.number, record.payload().size()});
    }
  }
  ShortVlrs shorter{
      .text = encode_vlrs(std::as_bytes(std::span(kept)), std::as_bytes(std::span(kept_extended))),
      .notes = {}};
  note_lost_vlrs(lost, why, shorter.notes);
  return shorter;
}

}  // namespace ptc
