// The header of PLY files, and every rule that can be checked before data is read.
//
// A header can count 2^63 records in a line. check_counts() compares the counts with the size of
// the file, so that a caller may allocate memory for as many records as the header counts.
#include <algorithm>
#include <array>
#include <utility>

#include "engine/io/cloud/ply_types.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMaxHeaderBytes = std::uint64_t{1} << 20;
constexpr std::size_t kMaxNames = 1024;  // elements of a file, properties of one element

std::optional<PlyType> type_named(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, PlyType>, 16> kNames = {
      {{"char", PlyType::int8},
       {"int8", PlyType::int8},
       {"uchar", PlyType::uint8},
       {"uint8", PlyType::uint8},
       {"short", PlyType::int16},
       {"int16", PlyType::int16},
       {"ushort", PlyType::uint16},
       {"uint16", PlyType::uint16},
       {"int", PlyType::int32},
       {"int32", PlyType::int32},
       {"uint", PlyType::uint32},
       {"uint32", PlyType::uint32},
       {"float", PlyType::float32},
       {"float32", PlyType::float32},
       {"double", PlyType::float64},
       {"float64", PlyType::float64}}};
  const auto* const found = std::ranges::find(kNames, name, [](const auto& n) { return n.first; });
  if (found == kNames.end()) return std::nullopt;
  return found->second;
}

bool is_integer(PlyType type) {
  return type != PlyType::float32 && type != PlyType::float64;
}

}  // namespace

std::uint64_t ply_least_bytes(const PlyElement& element, bool ascii) noexcept {
  std::uint64_t bytes = 0;
  for (const PlyProperty& property : element.properties) {
    bytes += ascii ? 2 : ply_type_bytes(property.length_type.value_or(property.type));
  }
  return bytes;
}

std::optional<std::size_t> PlyElement::find(std::string_view property) const {
  const auto found = std::ranges::find(properties, property, &PlyProperty::name);
  if (found == properties.end()) return std::nullopt;
  return static_cast<std::size_t>(found - properties.begin());
}

std::optional<std::size_t> PlyElement::find_any(
    std::initializer_list<std::string_view> names) const {
  for (const std::string_view candidate : names) {
    if (const auto index = find(candidate)) return index;
  }
  return std::nullopt;
}

bool PlyElement::has_list() const {
  return std::ranges::any_of(properties, [](const auto& p) { return p.length_type.has_value(); });
}

PlyReader::PlyReader(const std::filesystem::path& path) : stream_(path) {
  read_header();
  for (PlyElement& element : elements_) {
    if (!element.has_list()) element.fixed_bytes = ply_least_bytes(element, false);
  }
  check_counts();
}

const PlyElement* PlyReader::find(std::string_view element) const {
  const auto found = std::ranges::find(elements_, element, &PlyElement::name);
  return found == elements_.end() ? nullptr : &*found;
}

void PlyReader::read_header() {
  // Check the mark first; without it the file may be a single line of any length.
  std::string_view line;
  constexpr std::string_view kMark = "ply";
  const bool marked =
      stream_.max_left() > kMark.size() && stream_.next_line(line) && Words(line).next() == kMark;
  if (!marked) stream_.fail_at(0, "not a PLY file");

  // Read the format, then elements and properties up to the end of the header.
  bool has_format = false;
  while (stream_.next_line(line)) {
    if (stream_.offset() > kMaxHeaderBytes)
      stream_.fail_at_line("the PLY header has more than 1 MiB");
    Words words(line);
    const std::string_view keyword = words.next();
    if (keyword == "comment" || keyword == "obj_info" || keyword.empty()) continue;
    if (!has_format) {
      const std::string_view name = keyword == "format" ? words.next() : std::string_view();
      if (name == "ascii") {
        encoding_ = PlyEncoding::ascii;
      } else if (name == "binary_little_endian") {
        encoding_ = PlyEncoding::little_endian;
      } else if (name == "binary_big_endian") {
        encoding_ = PlyEncoding::big_endian;
      } else {
        stream_.fail_at_line("a PLY header must begin with its format");
      }
      if (words.next() != "1.0") stream_.fail_at_line("the PLY version is not 1.0");
      has_format = true;
    } else if (!read_header_line(line)) {
      return;
    }
  }
  stream_.fail_at_line("the PLY header has no end");
}

// Reads a line of the header behind its format. Returns false at the end of the header.
bool PlyReader::read_header_line(std::string_view line) {
  Words words(line);
  const std::string_view keyword = words.next();
  if (keyword == "end_header") return false;
  if (keyword == "element") {
    const std::string_view name = words.next();
    add_element(name, words.next());
  } else if (keyword == "property") {
    add_property(words.rest());
  } else {
    stream_.fail_at_line("the line does not begin with a keyword of a PLY header");
  }
  return true;
}

void PlyReader::add_element(std::string_view name, std::string_view count) {
  const std::optional<std::int64_t> number = parse_integer(count);
  if (name.empty() || !number || *number < 0) {
    stream_.fail_at_line("an element needs a name and a count");
  }
  if (find(name) != nullptr) stream_.fail_at_line("two elements have the same name");
  if (elements_.size() == kMaxNames) stream_.fail_at_line("there are more than 1024 elements");
  elements_.push_back({std::string(name), static_cast<std::uint64_t>(*number), {}, 0});
}

void PlyReader::add_property(std::string_view line) {
  if (elements_.empty()) stream_.fail_at_line("a property precedes the first element");
  Words words(line);
  PlyProperty property;
  std::string_view word = words.next();
  if (word == "list") {
    property.length_type = type_named(words.next());
    if (!property.length_type || !is_integer(*property.length_type)) {
      stream_.fail_at_line("the length of a list must have an integer type");
    }
    word = words.next();
  }
  const std::optional<PlyType> type = type_named(word);
  if (!type && (word == "int64" || word == "uint64")) {
    stream_.fail_at_line("a property has the type " + std::string(word) + ", which PLY has not");
  }
  if (!type) stream_.fail_at_line("a property has an unknown type");
  property.type = *type;
  property.name = words.next();
  if (property.name.empty()) stream_.fail_at_line("a property has no name");
  PlyElement& element = elements_.back();
  if (element.find(property.name)) stream_.fail_at_line("two properties have the same name");
  if (element.properties.size() == kMaxNames)
    stream_.fail_at_line("an element has more than 1024 properties");
  element.properties.push_back(std::move(property));
}

void PlyReader::check_counts() const {
  const bool ascii = encoding_ == PlyEncoding::ascii;
  // Allow for the last line of a text, which may lack its end.
  std::uint64_t left = stream_.max_left() + (ascii ? 1 : 0);
  for (const PlyElement& element : elements_) {
    const std::uint64_t least = ply_least_bytes(element, ascii);
    if (least == 0) continue;
    if (element.count > left / least) {
      stream_.fail_at(stream_.offset(), "element '" + element.name + "' has " +
                                            std::to_string(element.count) +
                                            " records, more than the file can hold");
    }
    left -= element.count * least;
  }
}

}  // namespace ptc
