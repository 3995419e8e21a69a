// Tells formats apart.
//
// Binary formats begin with bytes of their own. Text formats do not: the ending of the name counts
// if it is one of text, and else the first lines:
//
//   PTX   two lines of an integer, four of 3 numbers, four of 4
//   PTS   a line of an integer, then lines of 3 or more numbers
//   XYZ   lines of 3 or more numbers, equally many, after comments and names of columns
#include "engine/io/cloud/point_format.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/cloud/channel_names.h"
#include "engine/io/cloud/text_fields.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t kPeekBytes = 4096;

// Returns the ending of a name in lower case, that before .gz for compressed files.
std::string format_extension(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".gz" ? lower_extension(path.stem()) : extension;
}

std::optional<PointFormat> by_magic(std::string_view begin) {
  constexpr std::array kMagic = std::to_array<std::pair<std::string_view, PointFormat>>({
      {"LASF", PointFormat::las},
      {"ASTM-E57", PointFormat::e57},
      {"# .PCD", PointFormat::pcd},
      {"VERSION .", PointFormat::pcd},
      {"VERSION 0.", PointFormat::pcd},
      {"pptc", PointFormat::ptc},
      {"BgeoV", PointFormat::bgeo},
      {"PGEOMETRY V", PointFormat::bgeo},
      {"\x7fNSJ", PointFormat::bgeo},  // a later one, which the reader refuses by name
      {"\x9e\x02\0\0\x01\0"sv, PointFormat::pdb},
  });
  for (const auto& [magic, format] : kMagic) {
    if (begin.starts_with(magic)) return format;
  }
  const bool is_ply = begin.starts_with("ply") && begin.size() > 3 &&
                      "\n\r \t"sv.find(begin[3]) != std::string_view::npos;
  if (is_ply) return PointFormat::ply;
  // Later programs write the same geometry as JSON.
  const bool is_json = begin.starts_with('[') && begin.find("\"fileversion\"") < 64;
  return is_json ? std::optional(PointFormat::bgeo) : std::nullopt;
}

std::optional<PointFormat> by_extension(std::string_view extension) {
  constexpr std::array kEndings = std::to_array<std::pair<std::string_view, PointFormat>>({
      {".ply", PointFormat::ply},
      {".las", PointFormat::las},
      {".laz", PointFormat::las},
      {".e57", PointFormat::e57},
      {".pcd", PointFormat::pcd},
      {".ptc", PointFormat::ptc},
      {".bgeo", PointFormat::bgeo},
      {".ptx", PointFormat::ptx},
      {".pts", PointFormat::pts},
      {".xyz", PointFormat::xyz},
      {".xyzn", PointFormat::xyz},
      {".asc", PointFormat::xyz},
      {".txt", PointFormat::xyz},
      {".csv", PointFormat::xyz},
  });
  for (const auto& [ending, format] : kEndings) {
    if (extension == ending) return format;
  }
  return std::nullopt;
}

bool is_mesh_extension(std::string_view extension) {
  constexpr std::array kEndings = {".obj"sv, ".off"sv, ".stl"sv, ".gltf"sv, ".glb"sv};
  return std::ranges::find(kEndings, extension) != kEndings.end();
}

// A line that is not blank and no comment, as the sniffer sees it.
struct SniffedLine {
  std::size_t values = 0;   // 0 when a field is not a number
  std::size_t numbers = 0;  // fields that are numbers
  bool is_integer = false;  // a single integer
  bool is_names = false;    // no field is a number, and x, y and z are among them
};

SniffedLine sniff_line(std::string_view line) {
  SniffedLine result;
  std::size_t numbers = 0;
  std::array<bool, 3> xyz{};
  const std::vector<std::string_view> fields = unquoted_fields(line);
  for (const std::string_view field : fields) {
    if (parse_number(field) || has_decimal_comma(field)) ++numbers;
    const std::string name = bare_name(field);
    for (std::size_t i = 0; i < 3; ++i) {
      if (name == std::string_view("xyz").substr(i, 1)) xyz[i] = true;
    }
  }
  if (numbers == fields.size()) result.values = numbers;
  result.numbers = numbers;
  result.is_integer = fields.size() == 1 && parse_integer(fields[0]).has_value();
  result.is_names = numbers == 0 && xyz[0] && xyz[1] && xyz[2];
  return result;
}

// Splits the beginning of a file into lines. Nothing when it is not text.
std::optional<std::vector<SniffedLine>> sniff_lines(std::string_view begin, bool whole) {
  const auto is_control = [](char c) {
    return static_cast<unsigned char>(c) < 32 && c != '\n' && c != '\r' && c != '\t';
  };
  if (std::ranges::any_of(begin, is_control)) return std::nullopt;
  if (begin.starts_with("\xEF\xBB\xBF")) begin.remove_prefix(3);  // byte order mark
  // A line that goes on behind the beginning says nothing.
  if (!whole)
    begin = begin.substr(0, begin.rfind('\n') == std::string_view::npos ? 0 : begin.rfind('\n'));
  std::vector<SniffedLine> lines;
  while (!begin.empty()) {
    const std::size_t end = begin.find('\n');
    const std::string_view line = trimmed(begin.substr(0, end));
    begin = end == std::string_view::npos ? std::string_view() : begin.substr(end + 1);
    if (line.empty() || line.starts_with('#') || line.starts_with("//")) continue;
    lines.push_back(sniff_line(line));
  }
  return lines;
}

std::optional<PointFormat> by_lines(std::span<const SniffedLine> lines) {
  const auto have = [&](std::size_t first, std::size_t end, std::size_t values) {
    return std::ranges::all_of(lines.subspan(first, end - first),
                               [&](const SniffedLine& line) { return line.values == values; });
  };
  if (lines.size() >= 10 && lines[0].is_integer && lines[1].is_integer && have(2, 6, 3) &&
      have(6, 10, 4))
    return PointFormat::ptx;
  if (lines.size() >= 2 && lines[0].is_integer && lines[1].values >= 3) return PointFormat::pts;
  if (!lines.empty() && lines[0].is_names) lines = lines.subspan(1);
  if (!lines.empty() && lines[0].values >= 3 && have(0, lines.size(), lines[0].values))
    return PointFormat::xyz;
  return std::nullopt;
}

}  // namespace

std::optional<PointFormat> point_format(const std::filesystem::path& path) {
  const std::string extension = format_extension(path);
  if (is_mesh_extension(extension)) return std::nullopt;
  ByteStream stream(path);
  const std::string_view begin = stream.peek(kPeekBytes);
  if (const auto format = by_magic(begin)) return format;
  const std::optional<PointFormat> named = by_extension(extension);
  if (named == PointFormat::xyz || named == PointFormat::ptx) return named;
  const auto lines = sniff_lines(begin, begin.size() < kPeekBytes);
  const std::optional<PointFormat> sniffed = lines ? by_lines(*lines) : std::nullopt;
  // Many files of the name .pts are XYZ: they do not begin with a count.
  if (named == PointFormat::pts) return sniffed == PointFormat::xyz ? sniffed : named;
  return sniffed ? sniffed : named;
}

std::optional<PointFormat> format_of_name(const std::filesystem::path& path) {
  return by_extension(format_extension(path));
}

std::string hint_at_content(const std::filesystem::path& path) try {
  ByteStream stream(path);
  if (stream.compressed()) return "; it is packed by gzip: unpack it first, with gunzip";
  const std::string_view begin = stream.peek(kPeekBytes);
  const auto lines = sniff_lines(begin, begin.size() < kPeekBytes);
  const auto has_numbers = [](const SniffedLine& line) { return line.numbers >= 3; };
  if (!lines || std::ranges::none_of(*lines, has_numbers)) return "";
  return "; its lines have numbers: if they are x, y, z and more, end its name in .xyz, or state "
         "`format` xyz for standard input";
} catch (const DataError&) {  // its name says that it is packed, but it is not
  return "";
}

bool names_text_cloud(const std::filesystem::path& path) {
  const std::optional<PointFormat> format = format_of_name(path);
  return format == PointFormat::xyz || format == PointFormat::pts || format == PointFormat::ptx;
}

}  // namespace ptc
