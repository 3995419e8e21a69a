#include "engine/io/cloud/las_texts.h"

#include <cstring>

#include <nlohmann/json.hpp>

namespace ptc {
namespace {

constexpr std::size_t kMaxKept = std::size_t{1} << 14;  // bytes of records
constexpr std::size_t kVlrHeader = 54;

// Returns text whose code points are the bytes, as UTF-8.
std::string bytes_as_code_points(const std::string& bytes) {
  std::string text;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      text += c;
    } else {
      text += static_cast<char>(0xc0 | byte >> 6);
      text += static_cast<char>(0x80 | (byte & 0x3f));
    }
  }
  return text;
}

std::string hexadecimal(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

// Source: RFC 4648, section 4.
std::string encode_base64(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (k < count ? std::to_integer<std::uint32_t>(bytes[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k)
      text += k <= count ? kDigits[bits >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace

std::string make_las_header_text(const LasHeader& header, unsigned colour_bits) {
  nlohmann::ordered_json text;
  text["version"] = "1." + std::to_string(header.minor);
  text["format"] = header.format;
  text["record_length"] = header.record_bytes;
  text["scale"] = header.scale;
  text["offset"] = header.offset;
  text["system_id"] = bytes_as_code_points(header.system);
  text["software"] = bytes_as_code_points(header.software);
  text["day"] = header.day;
  text["year"] = header.year;
  text["global_encoding"] = header.encoding;
  text["guid"] = hexadecimal(header.guid);
  text["file_source_id"] = header.source;
  text["colour_bits"] = colour_bits;
  return text.dump();
}

LasRecordsText make_las_records_text(const InputFile& file, const LasHeader& header) {
  LasRecordsText text;
  std::vector<std::byte> kept;
  for (const LasRecord& record : header.records) {
    if (record.user == kLaszipUser || record.user == "copc") continue;
    if (record.bytes > kMaxKept || kVlrHeader + record.bytes > kMaxKept - kept.size()) {
      text.left_out.push_back(record);
      continue;
    }
    // A record's header begins with a reserved u16, user, number and length; the length has 2
    // bytes, or 8 in an extended record. The description of 32 bytes follows.
    const std::size_t at = kept.size();
    kept.resize(at + kVlrHeader + static_cast<std::size_t>(record.bytes));
    const auto out = std::span(kept).subspan(at);
    file.read_at(record.offset, out.first(20));
    const auto length = static_cast<std::uint16_t>(record.bytes);
    std::memcpy(out.data() + 20, &length, sizeof length);
    file.read_at(record.payload - 32, out.subspan(22, 32));
    file.read_at(record.payload, out.subspan(kVlrHeader));
  }
  text.base64 = encode_base64(kept);
  return text;
}

}  // namespace ptc
