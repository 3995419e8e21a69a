// The records of PLY files, by one of three ways:
//
//   read_ascii()    a line of words per record
//   read_fixed()    binary records of equal size: one range of bytes per record
//   read_lists()    binary records with lists: value by value, since each length says how far to go
//
// Lengths of lists come from the file. Nothing is allocated for a length before the bytes or words
// that it promises have been seen.
#include "engine/io/cloud/ply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/io/cloud/ply_types.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

// Reads a number of type T, with its bytes reversed if `swap` says so.
template <typename T>
double load_as(const std::byte* from, bool swap) noexcept {
  std::array<std::byte, sizeof(T)> bytes;
  std::memcpy(bytes.data(), from, sizeof(T));
  if (swap) std::ranges::reverse(bytes);
  return static_cast<double>(std::bit_cast<T>(bytes));
}

struct Range {
  double low;
  double high;
};

template <typename T>
constexpr Range range_of() {
  return {std::numeric_limits<T>::lowest(), std::numeric_limits<T>::max()};
}

// Says whether a value that is written as text fits the type of its property.
bool fits(double value, PlyType type) noexcept {
  constexpr std::array<Range, 6> kRanges = {range_of<std::int8_t>(),  range_of<std::uint8_t>(),
                                            range_of<std::int16_t>(), range_of<std::uint16_t>(),
                                            range_of<std::int32_t>(), range_of<std::uint32_t>()};
  if (type == PlyType::float32 || type == PlyType::float64) return true;
  const Range range = kRanges[static_cast<std::size_t>(type)];
  return value >= range.low && value <= range.high && value == std::trunc(value);
}

}  // namespace

double PlyReader::load(const std::byte* from, PlyType type) const noexcept {
  const bool swap =
      (encoding_ == PlyEncoding::big_endian) != (std::endian::native == std::endian::big);
  switch (type) {
    case PlyType::int8:
      return load_as<std::int8_t>(from, false);
    case PlyType::uint8:
      return load_as<std::uint8_t>(from, false);
    case PlyType::int16:
      return load_as<std::int16_t>(from, swap);
    case PlyType::uint16:
      return load_as<std::uint16_t>(from, swap);
    case PlyType::int32:
      return load_as<std::int32_t>(from, swap);
    case PlyType::uint32:
      return load_as<std::uint32_t>(from, swap);
    case PlyType::float32:
      return load_as<float>(from, swap);
    case PlyType::float64:
      break;
  }
  return load_as<double>(from, swap);
}

std::size_t PlyReader::list_length(const PlyRecord& record, double value) const {
  if (value < 0) fail(record, "a list has a negative length");
  return static_cast<std::size_t>(value);  // at most 2^32 - 1: lengths are integers
}

void PlyReader::read(const PlyElement& element, PlyRecord& record) {
  record.scalars.resize(element.properties.size());
  record.lists.resize(element.properties.size());
  if (encoding_ == PlyEncoding::ascii) {
    read_ascii(element, record);
  } else if (element.fixed_bytes > 0) {
    read_fixed(element, record);
  } else {
    read_lists(element, record);
  }
}

void PlyReader::read_fixed(const PlyElement& element, PlyRecord& record) {
  record.place = stream_.offset();
  const std::byte* at = stream_.take(element.fixed_bytes).data();
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyType type = element.properties[i].type;
    record.scalars[i] = load(at, type);
    at += ply_type_bytes(type);
  }
}

void PlyReader::read_lists(const PlyElement& element, PlyRecord& record) {
  record.place = stream_.offset();
  const auto next = [&](PlyType type) {
    return load(stream_.take(ply_type_bytes(type)).data(), type);
  };
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    if (!property.length_type) {
      record.scalars[i] = next(property.type);
      continue;
    }
    const std::size_t length = list_length(record, next(*property.length_type));
    const std::size_t bytes = ply_type_bytes(property.type);
    const std::byte* const values = stream_.take(length * bytes).data();
    record.lists[i].resize(length);
    for (std::size_t k = 0; k < length; ++k) {
      record.lists[i][k] = load(values + k * bytes, property.type);
    }
  }
}

void PlyReader::read_ascii(const PlyElement& element, PlyRecord& record) {
  // Find the next line that has words.
  std::string_view line;
  do {
    if (!stream_.next_line(line)) {
      stream_.fail_at_line("the file ends too early: records of element '" + element.name +
                           "' are missing");
    }
  } while (Words(line).rest().empty());
  record.place = stream_.line();

  // Read a word for each scalar; a length and that many words for each list.
  Words words(line);
  const auto value = [&](const PlyProperty& property, PlyType type) {
    const std::string_view word = words.next();
    if (word.empty()) fail(record, "the value of property '" + property.name + "' is missing");
    const std::optional<double> number = parse_number(word);
    if (!number) fail(record, "property '" + property.name + "' is not a number");
    if (!fits(*number, type)) fail(record, "property '" + property.name + "' is not of its type");
    return *number;
  };
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    if (!property.length_type) {
      record.scalars[i] = value(property, property.type);
      continue;
    }
    const std::size_t length = list_length(record, value(property, *property.length_type));
    record.lists[i].clear();  // it grows by words that exist, not by what the length says
    for (std::size_t k = 0; k < length; ++k) {
      record.lists[i].push_back(value(property, property.type));
    }
  }
  if (!words.next().empty())
    fail(record, "the line has more values than element '" + element.name + "'");
}

void PlyReader::skip(const PlyElement& element) {
  if (element.properties.empty()) return;
  if (encoding_ != PlyEncoding::ascii && element.fixed_bytes > 0) {
    // The counts were compared with the size of the file, so the product cannot overflow.
    stream_.skip(element.count * element.fixed_bytes);
    return;
  }
  PlyRecord record;
  for (std::uint64_t i = 0; i < element.count; ++i) read(element, record);
}

void PlyReader::require_end() {
  if (encoding_ != PlyEncoding::ascii) {
    if (!stream_.at_end())
      stream_.fail_at(stream_.offset(), "the file has more data than its header says");
    return;
  }
  std::string_view line;
  while (stream_.next_line(line)) {
    if (!Words(line).rest().empty())
      stream_.fail_at_line("the file has more data than its header says");
  }
}

void PlyReader::fail(const PlyRecord& record, const std::string& rule) const {
  if (encoding_ == PlyEncoding::ascii) stream_.fail_at_line(rule);
  stream_.fail_at(record.place, rule);
}

}  // namespace ptc
