#include "engine/io/cloud/las_texts.h"

#include <cstring>

#include <nlohmann/json.hpp>

#include "engine/io/cloud/las_vlrs.h"

namespace ptc {
namespace {

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

std::string make_las_records_text(const InputFile& file, const LasHeader& header,
                                  std::vector<std::string>& notes) {
  std::vector<std::byte> kept;
  std::vector<LostVlr> too_long, too_many;
  for (const LasRecord& record : header.records) {
    if (record.user == kLaszipUser || record.user == "copc") continue;
    const LostVlr lost{record.user, record.number, record.bytes};
    if (record.bytes > kMaxVlrPayload) {
      too_long.push_back(lost);
      continue;
    }
    const std::size_t bytes = kVlrHeaderBytes + static_cast<std::size_t>(record.bytes);
    if (bytes > kMaxVlrs - kept.size()) {
      too_many.push_back(lost);
      continue;
    }
    // A record's header begins with a reserved u16, user, number and length; the length has 2
    // bytes, or 8 in an extended record. The description of 32 bytes follows.
    const std::size_t at = kept.size();
    kept.resize(at + bytes);
    const auto out = std::span(kept).subspan(at);
    file.read_at(record.offset, out.first(20));
    const auto length = static_cast<std::uint16_t>(record.bytes);
    std::memcpy(out.data() + 20, &length, sizeof length);
    file.read_at(record.payload - 32, out.subspan(22, 32));
    file.read_at(record.payload, out.subspan(kVlrHeaderBytes));
  }
  note_lost_vlrs(too_long, "no record of more than 65,535 bytes is kept", notes);
  note_lost_vlrs(too_many, "only 1 MiB of records is kept", notes);
  return encode_vlrs(kept);
}

}  // namespace ptc
