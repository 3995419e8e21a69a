#include "tools/bench/experiments/scale_answers.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "format/checksum.h"

namespace ptc::bench {
namespace {

/// A property of the PLY's points.
struct Property {
  std::string name;
  std::size_t bytes = 0;  ///< 1: uchar, 4: float, 8: double
};

/// Lists the properties of a PLY.
/// @param header  text of the header before end_header
std::vector<Property> properties_of(const std::string& header) {
  std::vector<Property> properties;
  std::istringstream words(header);
  for (std::string word; words >> word;) {
    if (word != "property") continue;
    std::string type, name;
    words >> type >> name;
    properties.push_back({name, type == "double"  ? sizeof(double)
                                : type == "float" ? sizeof(float)
                                                  : sizeof(std::uint8_t)});
  }
  return properties;
}

/// Reads a uchar, a float or a double.
double value_at(const std::byte* at, std::size_t bytes) {
  if (bytes == 1) return std::to_integer<int>(*at);
  double wide = 0;
  float narrow = 0;
  std::memcpy(bytes == sizeof wide ? static_cast<void*>(&wide) : &narrow, at, bytes);
  return bytes == sizeof wide ? wide : static_cast<double>(narrow);
}

}  // namespace

void require_whole(const VerifyReport& report, std::uint64_t asked, std::uint64_t sorted) {
  if (!report.sound()) {
    throw DataError(fmt::format("{} points: the container is not sound: {}", asked,
                                line_of(report.findings.front())));
  }
  const std::uint64_t points = report.superblock->points;
  if (points != sorted) {
    throw DataError(fmt::format("{} points: {} went through the sort, {} are in the container",
                                asked, sorted, points));
  }
  const std::uint64_t off = std::max(points, asked) - std::min(points, asked);
  if (off > asked / 20)
    throw DataError(
        fmt::format("{} points: the city has {}, which is more than 5 % off", asked, points));
}

void require_same(const ScaleAnswers& first, const ScaleAnswers& now) {
  const auto require = [&](bool same, const char* what) {
    if (!same) throw DataError(fmt::format("{} points: another run gave {}", first.points, what));
  };
  require(first.points == now.points, "another number of points");
  require(first.content == now.content, "another container");
  require(first.values == now.values, "other values of the receivers");
}

std::uint64_t digest_of_values(const std::filesystem::path& ply, std::uint64_t points) {
  // Read the file and its header
  const InputFile file(ply);
  std::vector<std::byte> bytes(static_cast<std::size_t>(file.size()));
  file.read_at(0, bytes);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  constexpr std::string_view kEnd = "end_header\n";
  const std::size_t end = text.find(kEnd);
  if (end == std::string_view::npos) throw DataError(ply.string() + ": no end_header");
  const std::vector<Property> properties = properties_of(std::string(text.substr(0, end)));
  // Check every value
  std::size_t row = 0;
  for (const Property& property : properties) row += property.bytes;
  const std::byte* at = bytes.data() + end + kEnd.size();
  const auto body = std::span(bytes).subspan(end + kEnd.size());
  if (body.size() != points * row)
    throw DataError(fmt::format("{}: not the values of {} points", ply.string(), points));
  for (std::uint64_t point = 0; point < points; ++point) {
    for (const auto& [name, size] : properties) {
      if (!std::isfinite(value_at(at, size))) {
        throw DataError(fmt::format("{}: point {}: {} is not finite", ply.string(), point, name));
      }
      at += size;
    }
  }
  return xxh3_64(body);
}

}  // namespace ptc::bench
