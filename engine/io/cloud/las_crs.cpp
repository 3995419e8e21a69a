// Reads the coordinate reference system of a LAS file.
//
// WKT is a tree of KEYWORD[value, value, KEYWORD[...]]. The unit of x and y is a child of the node
// of the projected system, or of an axis of it:
//
//   COMPD_CS["both", PROJCS["plane", GEOGCS[... UNIT["degree",0.017]], UNIT["foot",0.3048]], ...]
//   PROJCRS["plane", BASEGEOGCRS[...], ..., AXIS["x",east,LENGTHUNIT["metre",1]], ...]
//
// Other units belong to ellipsoids, parameters and heights, so the way from the root decides.
//
// GeoTIFF keys are four u16 each: key, place, count, value. The first four u16 are a header, whose
// last is the number of keys. Place 0 says that the value stands there, 34736 that it is the index
// of a double in the record of that number. Source: OGC 18-010r7, OGC 01-009, OGC GeoTIFF 1.1
// (19-008r4), EPSG dataset (units 9001 to 9099).
#include "engine/io/cloud/las_crs.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <map>

#include "engine/io/text/text.h"
#include "format/text.h"

namespace ptc {
namespace {

constexpr std::string_view kProjection = "LASF_Projection";
constexpr unsigned kWktNumber = 2112;
constexpr unsigned kKeysNumber = 34735;
constexpr unsigned kDoublesNumber = 34736;

// GeoTIFF keys.
constexpr unsigned kModelType = 1024;
constexpr unsigned kGeographicType = 2048;
constexpr unsigned kProjectedType = 3072;
constexpr unsigned kLinearUnits = 3076;
constexpr unsigned kLinearUnitSize = 3077;
constexpr unsigned kVerticalUnits = 4099;
constexpr unsigned kModelGeographic = 2;
constexpr unsigned kUserDefined = 32767;

constexpr std::size_t kMaxDepth = 32;  // of WKT

bool is_one_of(std::string_view word, std::initializer_list<std::string_view> words) {
  return std::ranges::find(words, word) != words.end();
}

bool is_plane(std::string_view keyword) {
  return is_one_of(keyword, {"PROJCS", "PROJCRS", "PROJECTEDCRS", "LOCAL_CS", "ENGCRS",
                             "ENGINEERINGCRS", "GEOCCS"});
}

// Follows the tree of a WKT text and keeps the keywords from the root to the current node.
class WktScanner {
 public:
  explicit WktScanner(std::string_view text) : text_(text) {}

  WktFacts scan() {
    bool has_plane = false;
    bool has_angles = false;
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '"') {
        skip_quoted();
      } else if (c == '[' || c == '(') {
        ++at_;
        path_.push_back(take_keyword());
        if (path_.size() > kMaxDepth) return {};
        has_plane = has_plane || is_plane(path_.back());
        has_angles = has_angles || is_one_of(path_.back(), {"GEOGCS", "GEOGCRS", "GEODCRS"});
        if (is_unit_of_plane() && !facts_.metres_per_unit) facts_.metres_per_unit = read_unit();
      } else {
        if ((c == ']' || c == ')') && !path_.empty()) path_.pop_back();
        if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') {
          word_ += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
        } else {
          word_.clear();
        }
        ++at_;
      }
    }
    facts_.geographic = has_angles && !has_plane;
    return facts_;
  }

 private:
  std::string take_keyword() {
    std::string keyword;
    keyword.swap(word_);
    return keyword;
  }

  // Skips a text in quotes, in which "" stands for one quote.
  void skip_quoted() {
    const std::size_t end = text_.find('"', at_ + 1);
    at_ = end == std::string_view::npos ? text_.size() : end + 1;
    word_.clear();
  }

  [[nodiscard]] bool is_unit_of_plane() const {
    if (path_.size() < 2 || !is_one_of(path_.back(), {"UNIT", "LENGTHUNIT"})) return false;
    const std::string& parent = path_[path_.size() - 2];
    return is_plane(parent) ||
           (parent == "AXIS" && path_.size() > 2 && is_plane(path_[path_.size() - 3]));
  }

  // Reads the size of a unit: the number behind its name.
  [[nodiscard]] std::optional<double> read_unit() const {
    const std::size_t name = text_.find('"', at_);
    if (name == std::string_view::npos) return std::nullopt;
    const std::size_t name_end = text_.find('"', name + 1);
    if (name_end == std::string_view::npos) return std::nullopt;
    const std::size_t comma = text_.find_first_not_of(" \t\r\n", name_end + 1);
    if (comma == std::string_view::npos || text_[comma] != ',') return std::nullopt;
    std::string_view number = text_.substr(comma + 1);
    number = number.substr(0, number.find_first_of(",])"));
    Words words(number);
    const std::optional<double> size = parse_number(words.next());
    if (!size || !std::isfinite(*size) || *size <= 0) return std::nullopt;
    return size;
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::string word_;  // letters and digits right before at_, in upper case
  std::vector<std::string> path_;
  WktFacts facts_;
};

// The GeoTIFF keys of a file that have one short or one double.
struct GeoKeys {
  std::map<unsigned, unsigned> shorts;
  std::map<unsigned, double> doubles;

  [[nodiscard]] unsigned short_of(unsigned key) const {
    const auto found = shorts.find(key);
    return found == shorts.end() ? 0 : found->second;
  }
};

unsigned short_at(const std::vector<std::byte>& bytes, std::size_t index) {
  std::uint16_t value = 0;
  std::memcpy(&value, bytes.data() + 2 * index, sizeof value);
  return value;
}

// Reads the keys; those that do not lie inside their records are left out.
GeoKeys read_keys(const InputFile& file, const LasHeader& header) {
  GeoKeys keys;
  const auto payload = [&](unsigned number) {
    const LasRecord* const record = header.find(kProjection, number);
    if (record == nullptr) return std::vector<std::byte>();
    return read_las_payload(file, *record).value_or(std::vector<std::byte>());
  };
  const std::vector<std::byte> directory = payload(kKeysNumber);
  const std::vector<std::byte> doubles = payload(kDoublesNumber);
  if (directory.size() < 8) return keys;
  const std::size_t count = std::min<std::size_t>(short_at(directory, 3), directory.size() / 8 - 1);
  for (std::size_t i = 1; i <= count; ++i) {
    const unsigned key = short_at(directory, 4 * i);
    const unsigned place = short_at(directory, 4 * i + 1);
    const unsigned value = short_at(directory, 4 * i + 3);
    if (place == 0) keys.shorts[key] = value;
    if (place != kDoublesNumber || value >= doubles.size() / 8) continue;
    std::memcpy(&keys.doubles[key], doubles.data() + std::size_t{8} * value, 8);
  }
  return keys;
}

// Returns the length of a unit of the EPSG dataset in metres, or nothing for one that is not known
// here.
std::optional<double> unit_of_epsg(unsigned code) {
  switch (code) {
    case 9001:  // metre
      return 1;
    case 9002:  // international foot
      return 0.3048;
    case 9003:  // US survey foot
      return 1200.0 / 3937;
    case 9005:  // Clarke's foot
      return 0.3047972654;
    case 9036:  // kilometre
      return 1000;
    case 9096:  // yard
      return 0.9144;
    default:
      return std::nullopt;
  }
}

void read_geotiff(const InputFile& file, const LasHeader& header, LasCrs& crs) {
  const GeoKeys keys = read_keys(file, header);
  const auto is_code = [](unsigned code) { return code >= 1024 && code < kUserDefined; };

  // Name the system.
  const unsigned projected = keys.short_of(kProjectedType);
  const unsigned geographic = keys.short_of(kGeographicType);
  const bool is_geographic = keys.short_of(kModelType) == kModelGeographic;
  if (is_code(projected) && !is_geographic) crs.text = "EPSG:" + std::to_string(projected);
  if (is_code(geographic) && is_geographic) crs.text = "EPSG:" + std::to_string(geographic);
  if (is_geographic) {
    crs.notes.emplace_back("The coordinates x and y are angles, not lengths.");
    return;
  }

  // Find the unit.
  const unsigned unit = keys.short_of(kLinearUnits);
  crs.metres_per_unit = unit_of_epsg(unit);
  const auto size = keys.doubles.find(kLinearUnitSize);
  if (unit == kUserDefined && size != keys.doubles.end() && std::isfinite(size->second) &&
      size->second > 0) {
    crs.metres_per_unit = size->second;
  }
  const std::optional<double> vertical = unit_of_epsg(keys.short_of(kVerticalUnits));
  if (vertical && crs.metres_per_unit && *vertical != *crs.metres_per_unit)
    crs.notes.emplace_back("Heights are in another unit than x and y; they stay as they are.");
}

// Returns the WKT of a file; empty when it has none that is text.
std::string read_wkt(const InputFile& file, const LasHeader& header) {
  for (const std::string_view user : {kProjection, std::string_view("liblas")}) {
    const LasRecord* const record = header.find(user, kWktNumber);
    if (record == nullptr) continue;
    const auto payload = read_las_payload(file, *record);
    if (!payload) continue;
    std::string text(reinterpret_cast<const char*>(payload->data()), payload->size());
    text.resize(std::min(text.find('\0'), text.size()));
    const bool is_wkt = !text.empty() && std::isalpha(static_cast<unsigned char>(text[0])) != 0 &&
                        text.find_first_of("[(") != std::string::npos && is_utf8(text);
    if (is_wkt) return text;
  }
  return {};
}

}  // namespace

WktFacts find_wkt_facts(std::string_view wkt) {
  return WktScanner(wkt).scan();
}

LasCrs read_las_crs(const InputFile& file, const LasHeader& header) {
  LasCrs crs;
  const std::string wkt = read_wkt(file, header);
  if (wkt.empty()) {
    read_geotiff(file, header, crs);
    return crs;
  }
  const WktFacts facts = find_wkt_facts(wkt);
  crs.text = wkt;
  crs.metres_per_unit = facts.metres_per_unit;
  if (facts.geographic) crs.notes.emplace_back("The coordinates x and y are angles, not lengths.");
  return crs;
}

}  // namespace ptc
