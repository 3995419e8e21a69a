#include "engine/io/cloud/las_texts.h"

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
  std::vector<std::byte> kept, kept_extended;
  std::vector<LostVlr> lost;
  for (const LasRecord& record : header.records) {
    if (record.user == kLaszipUser || record.user == "copc") continue;
    const std::size_t room = kMaxVlrs - kept.size() - kept_extended.size();
    const std::uint64_t header_bytes = record.payload - record.offset;
    if (header_bytes > room || record.bytes > room - header_bytes) {
      lost.push_back({record.user, record.number, record.bytes});
      continue;
    }
    std::vector<std::byte>& records = record.extended ? kept_extended : kept;
    const std::size_t at = records.size();
    records.resize(at + static_cast<std::size_t>(header_bytes + record.bytes));
    file.read_at(record.offset, std::span(records).subspan(at));
  }
  note_lost_vlrs(lost, "only 1 MiB of records is kept", notes);
  return encode_vlrs(kept, kept_extended);
}

}  // namespace ptc
