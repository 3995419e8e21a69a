// The header of PCD files, and every rule that can be checked before the points are read.
#include "engine/io/cloud/pcd_header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMaxHeaderBytes = std::uint64_t{1} << 20;
constexpr std::size_t kMaxFields = 1024;

// The lines of a header as they were read.
struct Lines {
  std::vector<std::string> names;
  std::vector<std::string> types;
  std::vector<std::uint64_t> sizes;
  std::vector<std::uint64_t> counts;  // empty when there is no such line
  std::optional<std::uint64_t> width;
  std::optional<std::uint64_t> height;
  std::optional<std::uint64_t> points;
};

std::vector<std::string> words_of(const ByteStream& stream, Words words) {
  std::vector<std::string> all;
  for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
    if (all.size() == kMaxFields) stream.fail_at_line("the PCD header has more than 1024 fields");
    all.emplace_back(word);
  }
  return all;
}

std::uint64_t read_integer(const ByteStream& stream, std::string_view word) {
  const std::optional<std::int64_t> value = parse_integer(word);
  if (!value || *value < 0) stream.fail_at_line("a value in the PCD header is not a count");
  return static_cast<std::uint64_t>(*value);
}

std::vector<std::uint64_t> integers_of(const ByteStream& stream, const Words& words) {
  std::vector<std::uint64_t> all;
  for (const std::string& word : words_of(stream, words)) all.push_back(read_integer(stream, word));
  return all;
}

void check_version(const ByteStream& stream, std::string_view version) {
  if (version.starts_with('0')) version.remove_prefix(1);
  if (version != ".5" && version != ".6" && version != ".7")
    stream.fail_at_line("the PCD version is not 0.5, 0.6 or 0.7");
}

PcdData read_data(const ByteStream& stream, std::string_view name) {
  if (name == "ascii") return PcdData::ascii;
  if (name == "binary") return PcdData::binary;
  if (name == "binary_compressed") return PcdData::compressed;
  stream.fail_at_line("the data of a PCD file must be ascii, binary or binary_compressed");
}

// Reads a line of the header. Returns false at its last, DATA.
bool read_line(const ByteStream& stream, std::string_view line, Lines& lines, PcdHeader& header) {
  Words words(line);
  const std::string_view keyword = words.next();
  if (keyword.empty() || keyword.starts_with('#')) return true;
  if (keyword == "VERSION") {
    check_version(stream, words.next());
  } else if (keyword == "FIELDS" || keyword == "COLUMNS") {
    lines.names = words_of(stream, words);
  } else if (keyword == "SIZE") {
    lines.sizes = integers_of(stream, words);
  } else if (keyword == "TYPE") {
    lines.types = words_of(stream, words);
  } else if (keyword == "COUNT") {
    lines.counts = integers_of(stream, words);
  } else if (keyword == "WIDTH") {
    lines.width = read_integer(stream, words.next());
  } else if (keyword == "HEIGHT") {
    lines.height = read_integer(stream, words.next());
  } else if (keyword == "VIEWPOINT") {
    header.viewpoint = read_pcd_viewpoint(words);
    if (!header.viewpoint) stream.fail_at_line("a PCD viewpoint must have seven finite numbers");
  } else if (keyword == "POINTS") {
    lines.points = read_integer(stream, words.next());
  } else if (keyword == "DATA") {
    header.data = read_data(stream, words.next());
    return false;
  } else {
    stream.fail_at_line("the line does not begin with a keyword of a PCD header");
  }
  return true;
}

ChannelType read_type(const ByteStream& stream, const std::string& type, std::uint64_t size) {
  struct Entry {
    std::string_view type;
    std::uint64_t size;
    ChannelType is;
  };
  constexpr std::array kTypes = std::to_array<Entry>({{"I", 1, ChannelType::i8},
                                                      {"I", 2, ChannelType::i16},
                                                      {"I", 4, ChannelType::i32},
                                                      {"I", 8, ChannelType::i64},
                                                      {"U", 1, ChannelType::u8},
                                                      {"U", 2, ChannelType::u16},
                                                      {"U", 4, ChannelType::u32},
                                                      {"U", 8, ChannelType::u64},
                                                      {"F", 4, ChannelType::f32},
                                                      {"F", 8, ChannelType::f64}});
  for (const Entry& entry : kTypes) {
    if (entry.type == type && entry.size == size) return entry.is;
  }
  stream.fail_at_line("PCD has no type " + type + " of " + std::to_string(size) + " bytes");
}

void set_fields(const ByteStream& stream, Lines& lines, PcdHeader& header) {
  const std::size_t count = lines.names.size();
  if (count == 0) stream.fail_at_line("the PCD header names no fields");
  if (lines.counts.empty()) lines.counts.assign(count, 1);
  if (lines.sizes.size() != count || lines.types.size() != count || lines.counts.size() != count)
    stream.fail_at_line("FIELDS, SIZE, TYPE and COUNT of a PCD header must have as many values");
  for (std::size_t i = 0; i < count; ++i) {
    const ChannelType type = read_type(stream, lines.types[i], lines.sizes[i]);
    const std::uint64_t numbers = lines.counts[i];
    if (numbers == 0) stream.fail_at_line("the PCD field '" + lines.names[i] + "' has no numbers");
    if (numbers > (kMaxPcdPointBytes - header.point_bytes) / channel_bytes(type))
      stream.fail_at_line("a PCD point takes more than 1 MiB");
    header.fields.push_back({std::move(lines.names[i]), type, static_cast<std::size_t>(numbers)});
    header.point_bytes += header.fields.back().bytes();
  }
}

void set_counts(const ByteStream& stream, const Lines& lines, PcdHeader& header) {
  if (!lines.width && !lines.points) stream.fail_at_line("the PCD header has no WIDTH");
  header.height = lines.height.value_or(1);
  header.width = lines.width.value_or(lines.points.value_or(0));
  if (header.height > 0 && header.width > std::numeric_limits<std::uint64_t>::max() / header.height)
    stream.fail_at_line("WIDTH times HEIGHT of the PCD header is too large");
  header.points = header.width * header.height;
  if (lines.points && *lines.points != header.points)
    stream.fail_at_line("POINTS of the PCD header is not WIDTH times HEIGHT");
  if (header.height > 1 &&
      std::max(header.width, header.height) > std::numeric_limits<std::uint32_t>::max())
    stream.fail_at_line("WIDTH and HEIGHT of an organised PCD must be below 2^32");
}

}  // namespace

std::optional<std::array<double, 7>> read_pcd_viewpoint(Words words) {
  std::array<double, 7> numbers{};
  for (double& number : numbers) {
    const std::optional<double> value = parse_number(words.next());
    if (!value || !std::isfinite(*value)) return std::nullopt;
    number = *value;
  }
  return numbers;
}

PcdHeader read_pcd_header(ByteStream& stream) {
  PcdHeader header;
  Lines lines;
  std::string_view line;
  do {
    if (!stream.next_line(line)) stream.fail_at_line("the PCD header has no end");
    if (stream.offset() > kMaxHeaderBytes)
      stream.fail_at_line("the PCD header has more than 1 MiB");
  } while (read_line(stream, line, lines, header));
  set_fields(stream, lines, header);
  set_counts(stream, lines, header);
  return header;
}

}  // namespace ptc
