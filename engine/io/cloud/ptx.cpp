// Reads scans from PTX text (Leica Cyclone): one scan after another, each a grid of directions.
//
//   2                  columns of the grid
//   3                  rows
//   10 20 5            where the scanner stood
//   1 0 0              its axes, three lines, which the matrix repeats
//   ...
//   1 0 0 0            a matrix of four lines, the translation in the last:
//   ...                [x' y' z' 1] = [x y z 1] matrix
//   10 20 5 1
//   x y z intensity [r g b]     columns x rows lines, one column after another
//
// Points are relative to their scanner; one at 0 0 0 is a direction from which no echo came. The
// headers of all scans are read first, because the places of the scanners are known before points.
#include <array>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/cloud/text_fields.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

// The header of a scan.
struct PtxScan {
  std::uint64_t columns = 0;
  std::uint64_t rows = 0;
  glm::dvec3 scanner{0};  // where it stood, in the frame of all scans
  glm::dmat3 turn{1};     // position = turn point + move
  glm::dvec3 move{0};
  std::size_t values = 0;  // of each line; 0 when the scan has no points

  [[nodiscard]] std::uint64_t count() const { return columns * rows; }
};

// Reads the numbers of a line, at most out.size() of them. Returns their number.
std::size_t read_numbers(const ByteStream& stream, std::string_view line, std::span<double> out) {
  std::size_t count = 0;
  Words words(line);
  for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
    if (count == out.size()) stream.fail_at_line("the line has too many values");
    const std::optional<double> value = parse_number(word);
    if (!value) stream.fail_at_line("a value is not a number");
    out[count++] = *value;
  }
  return count;
}

// Reads a line of exactly out.size() finite numbers of a header.
void read_header_line(ByteStream& stream, std::span<double> out) {
  std::string_view line;
  if (!stream.next_line(line)) stream.fail_at_line("the header of a scan ends too early");
  if (read_numbers(stream, line, out) != out.size()) {
    stream.fail_at_line("a line in the header of a scan must have " + std::to_string(out.size()) +
                        " values");
  }
  for (const double value : out) {
    if (!std::isfinite(value)) stream.fail_at_line("a value in the header of a scan is not finite");
  }
}

std::uint64_t read_size(ByteStream& stream, std::string_view line) {
  const std::optional<std::int64_t> size = parse_integer(trimmed(line));
  if (!size || *size < 0 || *size > std::numeric_limits<std::uint32_t>::max()) {
    stream.fail_at_line("a scan must begin with its columns and rows, two lines of an integer");
  }
  return static_cast<std::uint64_t>(*size);
}

// Reads the header of the next scan; nothing at the end of the file.
std::optional<PtxScan> read_header(ByteStream& stream) {
  // The size of the grid.
  std::string_view line;
  do {
    if (!stream.next_line(line)) return std::nullopt;
  } while (trimmed(line).empty());
  PtxScan scan;
  scan.columns = read_size(stream, line);
  if (!stream.next_line(line)) stream.fail_at_line("the header of a scan ends too early");
  scan.rows = read_size(stream, line);

  // The scanner's place and axes, and the matrix.
  std::array<double, 3> triple{};
  read_header_line(stream, triple);
  scan.scanner = {triple[0], triple[1], triple[2]};
  for (int i = 0; i < 3; ++i) read_header_line(stream, triple);
  std::array<double, 4> row{};
  for (int i = 0; i < 4; ++i) {
    read_header_line(stream, row);
    if (row[3] != (i == 3 ? 1 : 0)) {
      stream.fail_at_line("the last column of the matrix of a scan must be 0 0 0 1");
    }
    (i == 3 ? scan.move : scan.turn[i]) = {row[0], row[1], row[2]};
  }
  // Some programs leave the place at 0; the scanner is at the origin of its points.
  if (scan.scanner == glm::dvec3(0)) scan.scanner = scan.move;

  // Each point takes a line of at least "0 0 0 0".
  constexpr std::uint64_t kLeastLine = 7;
  if (scan.columns > 0 && scan.rows > stream.max_left() / kLeastLine / scan.columns) {
    stream.fail_at_line("the scan has " + std::to_string(scan.columns) + " x " +
                        std::to_string(scan.rows) + " points, more than the file can hold");
  }
  return scan;
}

// Reads the headers of all scans, and passes over their points.
std::vector<PtxScan> read_headers(const std::filesystem::path& path) {
  ByteStream stream(path);
  std::vector<PtxScan> scans;
  while (std::optional<PtxScan> scan = read_header(stream)) {
    for (std::uint64_t i = 0; i < scan->count(); ++i) {
      std::string_view line;
      if (!stream.next_line(line)) {
        stream.fail_at_line("the file ends too early: " + std::to_string(scan->count() - i) +
                            " points of a scan are missing");
      }
      if (i > 0) continue;
      std::array<double, 7> values{};
      scan->values = read_numbers(stream, line, values);
      if (scan->values != 4 && scan->values != 7) {
        stream.fail_at_line(std::to_string(scan->values) + " values, but points have 4 or 7");
      }
    }
    scans.push_back(*scan);
  }
  if (scans.empty()) refuse_file(path, "the PTX file has no scan");
  return scans;
}

class PtxSource : public RecordSource {
 public:
  explicit PtxSource(const std::filesystem::path& path)
      : scans_(read_headers(path)), stream_(path) {
    for (const PtxScan& scan : scans_) has_colours_ = has_colours_ || scan.values == 7;
    add_fields();
    set_layout(PointLayout(path, fields_, {.owner = "the PTX points"}));
  }

  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    layout().describe(info);
    info.text.emplace("up", "z");
    std::uint64_t count = 0;
    for (std::size_t i = 0; i < scans_.size(); ++i) {
      count += scans_[i].count();
      info.scanners.push_back(scans_[i].scanner);
      if (has_colours_ && scans_[i].values == 4) {
        info.notes.push_back("Scan " + std::to_string(i) + " has no colours; its points are grey.");
      }
    }
    info.count = count;
    return info;
  }

 private:
  enum Field : std::size_t { kX, kY, kZ, kIntensity, kScan, kRow, kColumn, kRed };

  void add_fields() {
    std::size_t offset = 0;
    const auto add = [&](const char* name, ChannelType type) {
      fields_.push_back(make_field(name, type, offset));
      offset += channel_bytes(type);
    };
    for (const char* name : {"x", "y", "z"}) add(name, ChannelType::f64);
    add("intensity", ChannelType::f32);
    for (const char* name : {"scan", "row", "column"}) add(name, ChannelType::u32);
    fields_[Field::kScan].channel.role = ChannelRole::label;
    for (const char* name : {"red", "green", "blue"}) {
      if (has_colours_) add(name, ChannelType::u8);
    }
    packed_.resize(offset);
  }

  void store(Field field, double value) {
    const RecordField& to = fields_[field];
    if (store_number(value, to.channel.type, packed_.data() + to.offset)) return;
    stream_.fail_at_line("the colour is not an integer up to 255");
  }

  const std::byte* next_record() override {
    // Go on to the next scan that has points.
    while (done_ == of_scan_) {
      if (next_scan_ == scans_.size()) return nullptr;
      static_cast<void>(read_header(stream_));
      of_scan_ = scans_[next_scan_++].count();
      done_ = 0;
    }
    const PtxScan& scan = scans_[next_scan_ - 1];

    // Read the line.
    std::string_view line;
    if (!stream_.next_line(line)) stream_.fail_at_line("the file ends too early");
    std::array<double, 7> values{};
    if (read_numbers(stream_, line, values) != scan.values) {
      stream_.fail_at_line("the point must have " + std::to_string(scan.values) +
                           " values, as the first of its scan");
    }

    // Make a record of it. Positions become NaN where there was no echo; an infinite one is refused
    // as it is, before the matrix makes a NaN of it.
    const glm::dvec3 point(values[0], values[1], values[2]);
    glm::dvec3 position = point;
    if (point == glm::dvec3(0)) {
      position = glm::dvec3(std::numeric_limits<double>::quiet_NaN());
    } else if (std::isfinite(point.x + point.y + point.z)) {
      position = scan.turn * point + scan.move;
    }
    store(Field::kX, position.x);
    store(Field::kY, position.y);
    store(Field::kZ, position.z);
    store(Field::kIntensity, values[3]);
    store(Field::kScan, static_cast<double>(next_scan_ - 1));
    store(Field::kRow, static_cast<double>(done_ % scan.rows));
    store(Field::kColumn, static_cast<double>(done_ / scan.rows));
    constexpr double kGrey = 188;  // sRGB of 0.5
    for (std::size_t i = 0; has_colours_ && i < 3; ++i) {
      store(static_cast<Field>(Field::kRed + i), scan.values == 7 ? values[4 + i] : kGrey);
    }
    ++done_;
    return packed_.data();
  }

  void fail_record(const std::string& rule) const override { stream_.fail_at_line(rule); }

  std::vector<PtxScan> scans_;
  ByteStream stream_;
  bool has_colours_ = false;         // a scan has colours
  std::vector<RecordField> fields_;  // by Field
  std::vector<std::byte> packed_;    // the point that was read last
  std::size_t next_scan_ = 0;        // index of the scan behind the current one
  std::uint64_t of_scan_ = 0;        // points of the current scan
  std::uint64_t done_ = 0;           // points of it that were read
};

}  // namespace

PointFile open_ptx(const std::filesystem::path& path) {
  return open_source<PtxSource>(path);
}

}  // namespace ptc
