// The headers of .bgeo and .geo. Both lead to the same list of attributes.
#include "engine/io/cloud/geo_header.h"

#include <algorithm>
#include <array>
#include <utility>

#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/particle_names.h"
#include "engine/io/text/text.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxNumbers = 65536;  // of a point
constexpr std::size_t kMaxComponents = 16;  // of a channel
constexpr const char* kTooMany = "the attributes of a point have more than 65536 numbers";

enum class GeoType : std::int32_t { real = 0, integer = 1, index = 4, vector = 5 };

template <typename T>
T take_big(ByteStream& stream) {
  std::array<std::byte, sizeof(T)> bytes;
  std::ranges::reverse_copy(stream.take(sizeof(T)), bytes.begin());
  return load<T>(bytes.data(), 0);
}

std::string take_name(ByteStream& stream) {
  const std::size_t length = take_big<std::uint16_t>(stream);
  const std::span<const std::byte> bytes = stream.take(length);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void add_position(GeoHeader& header) {
  Channel position;
  position.name = "P";
  position.type = ChannelType::f32;
  position.components = 3;
  add_attribute(position, 0, header.fields);
  header.is_integer.assign(4, false);
}

// Adds an attribute behind the numbers that the point has so far.
void add(GeoHeader& header, const std::string& name, std::size_t size, GeoType type) {
  Channel channel;
  channel.name = name;
  const bool integer = type == GeoType::integer || type == GeoType::index;
  channel.type = integer ? ChannelType::i32 : ChannelType::f32;
  if (type == GeoType::index) {
    channel.role = ChannelRole::label;
    header.notes.push_back("The texts of the attribute '" + name +
                           "' are left out; their numbers are kept.");
  }
  if (type == GeoType::vector && size == 3) channel.role = ChannelRole::vector;
  if (name == "Cd" && size == 3) {
    channel.role = ChannelRole::colour;
    channel.colour_space = ColourSpace::rec709;
  }
  if (size > kMaxComponents) {
    header.notes.push_back("The attribute '" + name + "' has " + std::to_string(size) +
                           " numbers in each point and is left out.");
  } else {
    channel.components = static_cast<std::uint8_t>(size);
    const std::size_t first = header.fields.size();
    add_attribute(channel, header.numbers * 4, header.fields);
    const RecordField& field = header.fields[first];
    if (!field.plain) header.parts.emplace(field.channel.name, name);
  }
  header.numbers += size;
  header.is_integer.resize(header.numbers, integer);
}

void note_rest(GeoHeader& header, std::int64_t primitives) {
  if (primitives == 0) return;
  header.notes.push_back(std::to_string(primitives) +
                         " primitives and what belongs to them are left out.");
}

void read_binary_attribute(ByteStream& stream, GeoHeader& header) {
  const std::uint64_t place = stream.offset();
  const std::string name = take_name(stream);
  const std::size_t size = take_big<std::uint16_t>(stream);
  const auto type = static_cast<GeoType>(take_big<std::int32_t>(stream));
  if (size == 0) stream.fail_at(place, "the attribute '" + name + "' has no numbers");
  if (size > kMaxNumbers - header.numbers) stream.fail_at(place, kTooMany);
  switch (type) {
    case GeoType::real:
    case GeoType::integer:
    case GeoType::vector:
      stream.skip(4 * size);  // defaults
      break;
    case GeoType::index:
      for (auto left = take_big<std::int32_t>(stream); left > 0; --left) {
        static_cast<void>(take_name(stream));
      }
      break;
    default:
      stream.fail_at(place, "the attribute '" + name +
                                "' has a type that is not float, integer, index or vector");
  }
  add(header, name, size, type);
}

GeoHeader read_binary(ByteStream& stream) {
  constexpr std::string_view kMagic = "BgeoV";
  stream.skip(kMagic.size());
  if (take_big<std::int32_t>(stream) != 5) stream.fail_at(5, "the version of the BGEO is not 5");
  std::array<std::int32_t, 8> counts{};
  for (std::int32_t& count : counts) {
    const std::uint64_t place = stream.offset();
    count = take_big<std::int32_t>(stream);
    if (count < 0) stream.fail_at(place, "a count in the BGEO header is negative");
  }
  GeoHeader header;
  header.points = static_cast<std::uint64_t>(counts[0]);
  add_position(header);
  for (std::int32_t i = 0; i < counts[4]; ++i) read_binary_attribute(stream, header);
  note_rest(header, counts[1]);
  if (header.points > stream.max_left() / (4 * header.numbers)) {
    stream.fail_at(9, "the BGEO header counts " + std::to_string(header.points) +
                          " points, more than the file can hold");
  }
  return header;
}

std::string_view next_text(ByteStream& stream) {
  std::string_view line;
  do {
    if (!stream.next_line(line)) stream.fail_at_line("the header of the GEO ends too early");
  } while (Words(line).rest().empty());
  return line;
}

void read_text_attribute(ByteStream& stream, GeoHeader& header) {
  Words words(next_text(stream));
  const std::string name(words.next());
  const std::optional<std::int64_t> size = parse_integer(words.next());
  const std::string_view type = words.next();
  if (!size || *size < 1) stream.fail_at_line("an attribute needs a name, a size and a type");
  if (*size > static_cast<std::int64_t>(kMaxNumbers - header.numbers))
    stream.fail_at_line(kTooMany);
  const auto count = static_cast<std::size_t>(*size);
  if (type == "float") {
    add(header, name, count, GeoType::real);
  } else if (type == "int") {
    add(header, name, count, GeoType::integer);
  } else if (type == "vector") {
    add(header, name, count, GeoType::vector);
  } else if (type == "index") {
    add(header, name, count, GeoType::index);
  } else {
    stream.fail_at_line("the attribute '" + name +
                        "' has a type that is not float, int, index or vector");
  }
}

// Reads the value behind a keyword.
std::uint64_t read_count(ByteStream& stream, Words& words, std::string_view keyword) {
  const bool found = words.next() == keyword;
  const std::optional<std::int64_t> value = found ? parse_integer(words.next()) : std::nullopt;
  if (!value || *value < 0)
    stream.fail_at_line("the header of the GEO must have " + std::string(keyword) + " here");
  return static_cast<std::uint64_t>(*value);
}

GeoHeader read_text(ByteStream& stream) {
  Words magic(next_text(stream));
  if (magic.next() != "PGEOMETRY" || magic.next() != "V5")
    stream.fail_at_line("a GEO must begin with PGEOMETRY V5");
  GeoHeader header;
  header.text = true;
  add_position(header);
  Words words(next_text(stream));
  header.points = read_count(stream, words, "NPoints");
  const std::uint64_t primitives = read_count(stream, words, "NPrims");
  static_cast<void>(next_text(stream));  // groups
  words = Words(next_text(stream));
  const std::uint64_t attributes = read_count(stream, words, "NPointAttrib");
  if (attributes > 0 && Words(next_text(stream)).next() != "PointAttrib")
    stream.fail_at_line("the header of the GEO must have PointAttrib here");
  for (std::uint64_t i = 0; i < attributes; ++i) read_text_attribute(stream, header);
  note_rest(header, static_cast<std::int64_t>(primitives));
  if (header.points > (stream.max_left() + 1) / (2 * header.numbers)) {
    stream.fail_at_line("the GEO header counts " + std::to_string(header.points) +
                        " points, more than the file can hold");
  }
  return header;
}

}  // namespace

GeoHeader read_geo_header(ByteStream& stream) {
  const std::string_view begin = stream.peek(9);
  if (begin.starts_with("BgeoV")) return read_binary(stream);
  if (begin == "PGEOMETRY") return read_text(stream);
  if (begin.starts_with("\x7fNSJ") || begin.starts_with('[')) {
    stream.fail_at(
        0,
        "a geometry in the JSON format of Houdini 12 and later is not supported: save it "
        "as classic .bgeo (version 5)");
  }
  stream.fail_at(0, "not a classic BGEO or GEO file");
}

}  // namespace ptc
