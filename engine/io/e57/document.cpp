// Reads the XML section: pugixml parses it, and one function for each element takes what the reader
// of points needs. Elements that are not named here are passed over, because the format lets anyone
// add some. An element without text, such as <w type="Float"/>, stands for 0 or an empty text.
#include "engine/io/e57/document.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include <glm/gtc/quaternion.hpp>
#include <pugixml.hpp>

#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMaxXmlBytes = std::uint64_t{1} << 24;
constexpr int kMaxDepth = 64;
constexpr std::size_t kMaxScans = 65535;
constexpr std::string_view kNormalsUri = "http://www.libe57.org/E57_NOR_surface_normals.txt";

// Returns a name of the file for an error, not all of it when it is long.
std::string in_quotes(std::string_view name) {
  std::string text(1, '\'');
  text += name.substr(0, 64);
  return text + '\'';
}

// Returns a text without white space at its ends.
std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

// Returns the text of an element, which may be in several pieces.
std::string text_of(pugi::xml_node node) {
  std::string text;
  for (const pugi::xml_node piece : node.children()) {
    if (piece.type() == pugi::node_pcdata || piece.type() == pugi::node_cdata) {
      text += piece.value();
    }
  }
  return text;
}

class DocumentReader {
 public:
  explicit DocumentReader(E57Pages& pages) : pages_(pages) {}

  E57Document read() {
    parse();
    check_depth();
    root_ = xml_.child("e57Root");
    if (!root_) pages_.fail_at(pages_.xml_offset(), "the XML has no e57Root");
    E57Document document;
    document.crs = trimmed(text_of(root_.child("coordinateMetadata")));
    for (const pugi::xml_node node : root_.child("data3D").children("vectorChild")) {
      if (document.scans.size() == kMaxScans) fail(node, "the file has more than 65535 scans");
      document.scans.push_back(read_scan(node));
      const std::uint64_t records = document.scans.back().records;
      if (records > std::numeric_limits<std::uint64_t>::max() - document.records) {
        fail(node, "the file has more than 2^64 records");
      }
      document.records += records;
    }
    const auto pictures = root_.child("images2D").children("vectorChild");
    document.pictures = static_cast<std::size_t>(std::distance(pictures.begin(), pictures.end()));
    return document;
  }

 private:
  // Refuses the file because of an element.
  [[noreturn]] void fail(pugi::xml_node node, const std::string& rule) const {
    const std::ptrdiff_t at = std::max<std::ptrdiff_t>(node.offset_debug(), 0);
    pages_.fail_at(pages_.xml_offset() + static_cast<std::uint64_t>(at), rule);
  }

  void parse() {
    if (pages_.xml_bytes() > kMaxXmlBytes) {
      pages_.fail_at(pages_.xml_offset(), "the XML section has more than 16 MiB");
    }
    buffer_.resize(pages_.xml_bytes());
    pages_.read(pages_.xml_offset(), std::as_writable_bytes(std::span(buffer_)));
    const pugi::xml_parse_result result = xml_.load_buffer_inplace(
        buffer_.data(), buffer_.size(), pugi::parse_default, pugi::encoding_utf8);
    if (!result) {
      const auto at = static_cast<std::uint64_t>(std::max<std::ptrdiff_t>(result.offset, 0));
      pages_.fail_at(pages_.xml_offset() + at,
                     std::string("the XML is not well-formed: ") + result.description());
    }
  }

  // Refuses elements that are nested too deep. It visits all nodes without recursion.
  void check_depth() const {
    int depth = 1;
    pugi::xml_node node = xml_.first_child();
    while (node) {
      if (depth > kMaxDepth) fail(node, "the XML is nested more than 64 deep");
      if (node.first_child()) {
        node = node.first_child();
        ++depth;
        continue;
      }
      for (; node && !node.next_sibling(); --depth) node = node.parent();
      if (node) node = node.next_sibling();
    }
  }

  // Returns the number that an element or attribute holds; 0 for empty text.
  [[nodiscard]] double parse_finite(pugi::xml_node node, const char* name,
                                    std::string_view text) const {
    text = trimmed(text);
    if (text.empty()) return 0;
    const std::optional<double> value = parse_number(text);
    if (!value || !std::isfinite(*value)) fail(node, in_quotes(name) + " is not a finite number");
    return *value;
  }

  // Returns the number of a child; `otherwise` when there is no such child.
  [[nodiscard]] double number(pugi::xml_node parent, const char* name, double otherwise = 0) const {
    const pugi::xml_node node = parent.child(name);
    if (!node) return otherwise;
    const double value = parse_finite(node, name, text_of(node));
    if (node.attribute("type").value() != std::string_view("ScaledInteger")) return value;
    return value * number_attribute(node, "scale", 1) + number_attribute(node, "offset", 0);
  }

  [[nodiscard]] double number_attribute(pugi::xml_node node, const char* name,
                                        double otherwise) const {
    const pugi::xml_attribute attribute = node.attribute(name);
    return attribute ? parse_finite(node, name, attribute.value()) : otherwise;
  }

  [[nodiscard]] std::int64_t integer_attribute(pugi::xml_node node, const char* name,
                                               std::optional<std::int64_t> otherwise) const {
    const pugi::xml_attribute attribute = node.attribute(name);
    if (!attribute && otherwise) return *otherwise;
    const auto value = parse_integer(trimmed(attribute.value()));
    if (!value)
      fail(node, in_quotes(name) + " of " + in_quotes(node.name()) + " is not an integer");
    return *value;
  }

  [[nodiscard]] std::uint64_t count_attribute(pugi::xml_node node, const char* name) const {
    const std::int64_t value = integer_attribute(node, name, std::nullopt);
    if (value < 0) fail(node, in_quotes(name) + " is negative");
    return static_cast<std::uint64_t>(value);
  }

  [[nodiscard]] E57Scan read_scan(pugi::xml_node node) const {
    E57Scan scan;
    if (const pugi::xml_node pose = node.child("pose")) read_pose(pose, scan);
    scan.colour_limits = read_limits(node.child("colorLimits"));
    scan.start = number(node.child("acquisitionStart"), "dateTimeValue");
    const pugi::xml_node points = node.child("points");
    if (!points) return scan;
    if (points.attribute("type").value() != std::string_view("CompressedVector")) {
      fail(points, "the points of a scan are no CompressedVector");
    }
    scan.records = count_attribute(points, "recordCount");
    if (scan.records > 0) scan.section = count_attribute(points, "fileOffset");
    check_codecs(points.child("codecs"));
    const pugi::xml_node prototype = points.child("prototype");
    if (!prototype) fail(points, "the points of a scan have no prototype");
    for (const pugi::xml_node field : prototype.children()) {
      if (field.type() != pugi::node_element) continue;
      if (scan.fields.size() == E57Scan::kMaxFields) {
        fail(field, "a scan has more than 256 fields");
      }
      E57Field read = read_field(field);
      if (scan.find(read.name)) fail(field, "two fields have the name " + in_quotes(read.name));
      scan.fields.push_back(std::move(read));
    }
    return scan;
  }

  void read_pose(pugi::xml_node pose, E57Scan& scan) const {
    scan.has_pose = true;
    const pugi::xml_node move = pose.child("translation");
    scan.translation = {number(move, "x"), number(move, "y"), number(move, "z")};
    const pugi::xml_node turn = pose.child("rotation");
    if (!turn) return;
    // Normalise the quaternion; scale it first, because squares of large components could overflow.
    std::array<double, 4> q = {number(turn, "w", 1), number(turn, "x"), number(turn, "y"),
                               number(turn, "z")};
    double most = 0;
    for (const double component : q) most = std::max(most, std::abs(component));
    if (most == 0) fail(turn, "the quaternion of a rotation is 0");
    double squares = 0;
    for (double& component : q) {
      component /= most;
      squares += component * component;
    }
    const double length = std::sqrt(squares);
    scan.rotation =
        glm::mat3_cast(glm::dquat(q[0] / length, q[1] / length, q[2] / length, q[3] / length));
  }

  // Returns the limits of colours, or nothing when the file has none from which a range follows.
  [[nodiscard]] std::optional<std::array<E57Limits, 3>> read_limits(pugi::xml_node node) const {
    constexpr std::array<std::array<const char*, 2>, 3> kNames = {
        {{"colorRedMinimum", "colorRedMaximum"},
         {"colorGreenMinimum", "colorGreenMaximum"},
         {"colorBlueMinimum", "colorBlueMaximum"}}};
    std::array<E57Limits, 3> limits;
    for (std::size_t i = 0; i < limits.size(); ++i) {
      limits[i] = {number(node, kNames[i][0]), number(node, kNames[i][1])};
      if (!(limits[i].low < limits[i].high) || !std::isfinite(limits[i].high - limits[i].low)) {
        return std::nullopt;
      }
    }
    return limits;
  }

  // Refuses codecs other than bitPackCodec, which is the one of all fields that no codec names.
  void check_codecs(pugi::xml_node codecs) const {
    for (const pugi::xml_node entry : codecs.children("vectorChild")) {
      for (const pugi::xml_node codec : entry.children()) {
        const std::string_view name = codec.name();
        if (codec.type() == pugi::node_element && name != "inputs" && name != "bitPackCodec") {
          fail(codec, "the codec " + in_quotes(name) + " is not supported");
        }
      }
    }
  }

  [[nodiscard]] E57Field read_field(pugi::xml_node node) const {
    E57Field field;
    field.name = field_name(node.name());
    const std::string_view type = node.attribute("type").value();
    if (type == "Integer" || type == "ScaledInteger") {
      using Limits = std::numeric_limits<std::int64_t>;
      field.type = type == "Integer" ? E57Type::integer : E57Type::scaled;
      field.minimum = integer_attribute(node, "minimum", Limits::min());
      field.maximum = integer_attribute(node, "maximum", Limits::max());
      if (field.minimum > field.maximum) {
        fail(node, "the minimum of field " + in_quotes(field.name) + " is above its maximum");
      }
      if (field.type == E57Type::integer) return field;
      field.scale = number_attribute(node, "scale", 1);
      field.offset = number_attribute(node, "offset", 0);
      if (field.scale == 0) fail(node, "the scale of field " + in_quotes(field.name) + " is 0");
    } else if (type == "Float") {
      const std::string_view precision = node.attribute("precision").value();
      if (precision != "" && precision != "single" && precision != "double") {
        fail(node, "the precision of field " + in_quotes(field.name) + " is not known");
      }
      field.type = precision == "single" ? E57Type::float32 : E57Type::float64;
      // What a float states of its range only helps, so nothing that it states is refused.
      const auto low = parse_number(trimmed(node.attribute("minimum").value()));
      const auto high = parse_number(trimmed(node.attribute("maximum").value()));
      if (low && high && *low < *high && std::isfinite(*high - *low)) {
        field.range = std::array{*low, *high};
      }
    } else if (type == "String") {
      field.type = E57Type::text;
    } else {
      fail(node, "field " + in_quotes(field.name) + " has the type " + in_quotes(type) +
                     ", which is not supported");
    }
    return field;
  }

  // Returns a field's name, in which the prefix of the surface normals is always "nor:".
  [[nodiscard]] std::string field_name(const std::string& name) const {
    const std::size_t colon = name.find(':');
    if (colon == std::string::npos) return name;
    const pugi::xml_attribute uri = root_.attribute(("xmlns:" + name.substr(0, colon)).c_str());
    return uri.value() == kNormalsUri ? "nor" + name.substr(colon) : name;
  }

  E57Pages& pages_;
  std::vector<char> buffer_;  // xml_ points into it
  pugi::xml_document xml_;
  pugi::xml_node root_;
};

}  // namespace

unsigned E57Field::bits() const noexcept {
  switch (type) {
    case E57Type::integer:
    case E57Type::scaled:
      return static_cast<unsigned>(std::bit_width(static_cast<std::uint64_t>(maximum) -
                                                  static_cast<std::uint64_t>(minimum)));
    case E57Type::float32:
      return 32;
    case E57Type::float64:
      return 64;
    case E57Type::text:
      break;
  }
  return 8;
}

double E57Field::real(std::uint64_t value) const noexcept {
  switch (type) {
    case E57Type::integer:
    case E57Type::scaled:
      return static_cast<double>(static_cast<std::int64_t>(value)) * scale + offset;
    case E57Type::float32:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(value)));
    case E57Type::float64:
      return std::bit_cast<double>(value);
    case E57Type::text:
      break;
  }
  return 0;
}

std::uint64_t E57Scan::record_bits() const noexcept {
  std::uint64_t bits = 0;
  for (const E57Field& field : fields) bits += field.bits();
  return bits;
}

std::optional<std::size_t> E57Scan::find(std::string_view name) const noexcept {
  const auto found = std::ranges::find(fields, name, &E57Field::name);
  if (found == fields.end()) return std::nullopt;
  return static_cast<std::size_t>(found - fields.begin());
}

E57Document read_e57_document(E57Pages& pages) {
  return DocumentReader(pages).read();
}

}  // namespace ptc
