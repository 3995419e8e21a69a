// Decides the head of a LAS file and the records before and behind its points.
//
// A cloud that came from LAS carries two texts. `las.header` is a JSON object with the members
// format, record_length, scale, offset, system or system_id, software (bytes as code points), day,
// year, encoding or global_encoding, file_source_id and guid (32 hexadecimal digits); `las.vlrs`
// (las_vlrs.h) has its variable length records, extended or not, as they lay there. Both may come
// from a file of anyone, so nothing in them is taken for granted: what is not of the expected form
// is passed over.
//
// Other clouds get steps of a power of ten, the finest with which 32 bits suffice:
//
//   |<------------- side of the bounds ------------->|
//   low               offset, a round number       high      |X| <= side / step <= 2^31 - 1
#include "engine/io/cloud/las_plan.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/laz/layout.h"
#include "engine/io/text/text.h"

namespace ptc::las {
namespace {

using Json = nlohmann::json;

constexpr double kMostStep = std::numeric_limits<std::int32_t>::max();
constexpr double kStepNoise = 1e-3;               // of a step: what containers round
constexpr double kStepOfPlace = 1e-3;             // when all points lie in one place
constexpr std::uint16_t kKeptEncoding = 1U | 8U;  // kind of the times, synthetic return numbers

// Returns 10^exponent as the nearest double, which std::pow() may miss.
double power_of_ten(int exponent) {
  return parse_number(fmt::format("1e{}", exponent)).value_or(1);
}

// Sets `out` to the text of a member, whose code points are bytes; a code point that is no byte is
// left as it is.
void take_text(const Json& head, const char* name, std::string& out) {
  const auto member = head.find(name);
  if (member == head.end() || !member->is_string()) return;
  const auto text = member->get<std::string>();
  out.clear();
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if ((byte == 0xc2 || byte == 0xc3) && i + 1 < text.size()) {  // of U+0080 to U+00ff
      out += static_cast<char>((byte & 3) << 6 | (static_cast<unsigned char>(text[++i]) & 0x3f));
    } else {
      out += text[i];
    }
  }
}

void take_number(const Json& head, const char* name, std::uint16_t& out) {
  const auto member = head.find(name);
  if (member == head.end() || !member->is_number_unsigned()) return;
  const auto value = member->get<std::uint64_t>();
  if (value <= std::numeric_limits<std::uint16_t>::max()) out = static_cast<std::uint16_t>(value);
}

void take_guid(const Json& head, std::array<std::byte, 16>& out) {
  const auto member = head.find("guid");
  if (member == head.end() || !member->is_string()) return;
  const auto digits = member->get<std::string>();
  constexpr std::string_view kDigits = "0123456789abcdef";
  if (digits.size() != 32 || digits.find_first_not_of(kDigits) != std::string::npos) return;
  const auto value = [&](std::size_t i) { return kDigits.find(digits[i]); };
  for (std::size_t i = 0; i < 16; ++i)
    out[i] = static_cast<std::byte>(16 * value(2 * i) + value(2 * i + 1));
}

std::optional<glm::dvec3> find_triple(const Json& head, const char* name) {
  const auto member = head.find(name);
  if (member == head.end() || !member->is_array() || member->size() != 3) return std::nullopt;
  glm::dvec3 triple;
  for (int i = 0; i < 3; ++i) {
    const Json& number = (*member)[static_cast<std::size_t>(i)];
    if (!number.is_number()) return std::nullopt;
    triple[i] = number.get<double>();
    if (!std::isfinite(triple[i])) return std::nullopt;
  }
  return triple;
}

// Says whether the steps of all coordinates within the bounds are integers of 32 bits.
bool steps_hold(const Bounds& bounds, const glm::dvec3& scale, const glm::dvec3& offset) {
  for (int i = 0; i < 3; ++i) {
    if (!(scale[i] > 0)) return false;
    for (const double corner : {bounds.low[i], bounds.high[i]}) {
      const double steps = std::round(std::abs((corner - offset[i]) / scale[i]));
      if (!bounds.empty() && !(steps <= kMostStep)) return false;
    }
  }
  return true;
}

// Returns the finest step for coordinates that are at most `side` away from their offset.
double choose_step(double side) {
  const double finest = side / 2e9;      // well below kMostStep, whatever is rounded on the way
  if (finest == 0) return kStepOfPlace;  // its offset says it all
  int exponent = static_cast<int>(std::floor(std::log10(finest)));
  while (power_of_ten(exponent) < finest) ++exponent;
  return power_of_ten(exponent);
}

// Returns a round number near the middle of an interval, at most its length from either end.
double choose_offset(double low, double high) {
  const double side = high - low;
  if (side == 0) return low;
  const double unit = power_of_ten(static_cast<int>(std::floor(std::log10(side))));
  const double middle = low + side / 2;
  const double round = std::round(middle / unit) * unit;
  const bool is_near =
      std::isfinite(round) && std::abs(round - low) <= side && std::abs(round - high) <= side;
  return is_near ? round : middle;
}

void choose_steps(const PointWriteInfo& info, Head& head) {
  head.own_steps = true;
  head.scale = glm::dvec3(kStepOfPlace);
  head.offset = glm::dvec3(0);
  if (info.bounds.empty()) return;
  const glm::dvec3 sides = info.bounds.high - info.bounds.low;
  head.scale = glm::dvec3(choose_step(std::max({sides.x, sides.y, sides.z})));
  for (int i = 0; i < 3; ++i) {
    head.offset[i] = choose_offset(info.bounds.low[i], info.bounds.high[i]);
  }
}

// Says whether a record describes how points are stored in the file that it comes from.
bool is_about_storage(std::string_view user, unsigned id) {
  if (user == "LASF_Spec")  // extra bytes, descriptors and packets of waveforms
    return id == 4 || (id >= 100 && id < 355) || id == 65535;
  return user == "laszip encoded" || user == "copc";
}

// Returns the records that stay true in another file.
Records kept_records(const std::vector<Vlr>& originals) {
  Records kept;
  for (const Vlr& record : originals) {
    if (is_about_storage(record.user, record.number)) continue;
    const auto whole = std::as_bytes(std::span(record.bytes));
    std::vector<std::byte>& records = record.extended ? kept.extended : kept.bytes;
    records.insert(records.end(), whole.begin(), whole.end());
    ++(record.extended ? kept.extended_count : kept.count);
    kept.has_wkt |= record.user == "LASF_Projection" && record.number == 2112;
    kept.has_geotiff |= record.user == "LASF_Projection" && record.number == 34735;
  }
  return kept;
}

// Returns the text `las.header`; no object where there is none.
Json read_header_text(const PointWriteInfo& info) {
  const auto text = info.text.find("las.header");
  return text == info.text.end() ? Json() : Json::parse(text->second, nullptr, false);
}

}  // namespace

Head plan_head(const PointWriteInfo& info) {
  Head head;
  const Json from = read_header_text(info);
  if (!from.is_object()) {
    choose_steps(info, head);
    return head;
  }
  take_text(from, "system", head.system);
  take_text(from, "system_id", head.system);
  take_text(from, "software", head.software);
  take_number(from, "day", head.day);
  take_number(from, "year", head.year);
  take_number(from, "encoding", head.encoding);
  take_number(from, "global_encoding", head.encoding);
  take_number(from, "file_source_id", head.source);
  head.encoding &= kKeptEncoding;
  take_guid(from, head.guid);
  const auto scale = find_triple(from, "scale"), offset = find_triple(from, "offset");
  if (scale && offset && steps_hold(info.bounds, *scale, *offset)) {
    head.scale = *scale;
    head.offset = *offset;
  } else {
    choose_steps(info, head);
  }
  return head;
}

bool moves_positions(const PointWriteInfo& info, const Head& head) {
  if (!info.rounding) return head.own_steps;
  if (!head.own_steps) return info.rounding->step_error > kStepNoise;
  // The offset is a multiple of the step, a power of ten, so decimals of as many digits lie on it
  const unsigned decimals = info.rounding->decimals;
  return decimals > kMostDecimals || power_of_ten(-static_cast<int>(decimals)) < head.scale.x;
}

std::vector<LasName> original_names(const PointWriteInfo& info) {
  // Find out how the records of the file were laid out
  const Json from = read_header_text(info);
  std::uint16_t format = 0, record_bytes = 0;
  if (!from.is_object()) return {};
  take_number(from, "format", format);
  take_number(from, "record_length", record_bytes);
  if (format > kMaxLasFormat || record_bytes < laz::format_bytes(format)) return {};
  LasHeader header;
  header.format = format;
  header.record_bytes = record_bytes;

  // Read the descriptions again, which gives each field the channel that it became
  const auto text = info.text.find(kLasRecordsKey);
  const auto originals = text == info.text.end() ? std::nullopt : decode_vlrs(text->second);
  if (!originals) return {};
  const auto describes = [](const Vlr& record) {
    return record.user == "LASF_Spec" && record.number == 4 && !record.payload().empty();
  };
  const auto found = std::ranges::find_if(*originals, describes);
  if (found == originals->end()) return {};
  return make_las_fields(header, std::as_bytes(std::span(found->payload()))).names;
}

void Records::add(std::string_view user, std::uint16_t id, std::string_view description,
                  std::string_view content) {
  const auto add_padded = [this](std::string_view text, std::size_t size) {
    const auto raw = std::as_bytes(std::span(text.substr(0, size)));
    bytes.insert(bytes.end(), raw.begin(), raw.end());
    bytes.resize(bytes.size() + size - raw.size());
  };
  append_value(bytes, std::uint16_t{0});
  add_padded(user, 16);
  append_value(bytes, id);
  append_value(bytes, static_cast<std::uint16_t>(content.size()));
  add_padded(description, 32);
  add_padded(content, content.size());
  ++count;
}

Records plan_records(const PointWriteInfo& info) {
  Records records;
  if (const auto text = info.text.find(kLasRecordsKey); text != info.text.end()) {
    if (const auto originals = decode_vlrs(text->second)) {
      records = kept_records(*originals);
    } else {
      records.dropped.push_back("The text las.vlrs is damaged: its records are left out.");
    }
  }
  const auto crs = info.text.find("crs");
  if (records.has_wkt || crs == info.text.end()) return records;
  if (crs->second.find('[') == std::string::npos) {  // a name such as EPSG:4326
    if (!records.has_geotiff) {
      records.dropped.push_back("The coordinate reference system is left out: it is not WKT.");
    }
    return records;
  }
  const std::string zero_ended = crs->second + '\0';
  if (zero_ended.size() > std::numeric_limits<std::uint16_t>::max()) {
    records.dropped.push_back(
        "The coordinate reference system is left out: its text has more than 65,534 bytes.");
    return records;
  }
  records.add("LASF_Projection", 2112, "OGC COORDINATE SYSTEM WKT", zero_ended);
  records.has_wkt = true;
  return records;
}

}  // namespace ptc::las
