// Reads clouds from PCD (Point Cloud Library).
//
// The points follow the header in one of three ways, each with a source:
//
//   ascii        a line of words for each point
//   binary       packed points, one after another
//   compressed   u32 compressed bytes, u32 bytes, then LZF of the first field of all points, the
//                second field of all points, ...
//
// A compressed file is decompressed once, to check it and to remember where each field begins. From
// then on every field has an LzfReader of its own, so memory does not grow with the file.
//
// VIEWPOINT does not move points: the format calls it an acquisition viewpoint that may help to
// orient normals, and writers store points in the frame in which it is given. It becomes the place
// of the scanner, unless it is the default of a cloud that is no grid, which says nothing. The text
// `pcd.viewpoint` keeps all of its numbers for the writer.
#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/lzf.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/pcd_header.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/cloud/text_fields.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxComponents = 16;  // of a channel
// PCL writes through a map of the file and leaves it longer than the points by less than a page.
constexpr std::size_t kMaxPadding = 4096;
constexpr const char* kMoreData = "the file has more data than its header says";

// What a packed record is: the binary point as the file has it, then row and column if it is a
// grid.
struct PcdRecord {
  std::vector<RecordField> fields;
  std::size_t bytes = 0;
  bool has_grid = false;
  std::vector<std::string> notes;
};

std::string lowered(std::string_view name) {
  std::string lower(name);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return lower;
}

// Lists the fields of a packed record.
PcdRecord describe_record(const PcdHeader& header) {
  PcdRecord record;
  for (const PcdField& field : header.fields) {
    const std::size_t offset = record.bytes;
    record.bytes += field.bytes();
    if (field.name == "_") continue;  // padding
    const std::string name = lowered(field.name);
    const bool four_bytes = field.count == 1 && channel_bytes(field.type) == 4;
    if (four_bytes && (name == "rgb" || name == "rgba")) {
      // A number 0xAARRGGBB, which may be stored as the bits of a float.
      record.fields.push_back(make_field("red", ChannelType::u8, offset + 2));
      record.fields.push_back(make_field("green", ChannelType::u8, offset + 1));
      record.fields.push_back(make_field("blue", ChannelType::u8, offset));
      if (name == "rgba") record.fields.push_back(make_field("alpha", ChannelType::u8, offset + 3));
      continue;
    }
    if (field.count > kMaxComponents) {
      record.notes.push_back("The field '" + field.name + "' has " + std::to_string(field.count) +
                             " numbers in each point and is left out.");
      continue;
    }
    record.fields.push_back(
        make_field(is_surfel_name(name) ? name : field.name, field.type, offset));
    record.fields.back().channel.components = static_cast<std::uint8_t>(field.count);
  }
  record.has_grid = header.height > 1;
  for (const char* name : {"row", "column"}) {
    if (!record.has_grid) break;
    record.fields.push_back(make_field(name, ChannelType::u32, record.bytes));
    record.bytes += sizeof(std::uint32_t);
  }
  return record;
}

// Says whether these bytes may follow the last point.
bool is_padding(std::span<const std::byte> bytes) {
  return bytes.size() <= kMaxPadding &&
         std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte{0}; });
}

PointLayout make_layout(const std::filesystem::path& path, const PcdRecord& record) {
  return {path, record.fields, {.owner = "the PCD points", .nan_is_no_normal = true}};
}

// Sets row and column of a packed record.
void set_grid(const PcdHeader& header, std::uint64_t index, std::byte* record) {
  if (header.height <= 1) return;
  const auto row = static_cast<std::uint32_t>(index / header.width);
  const auto column = static_cast<std::uint32_t>(index % header.width);
  std::memcpy(record + header.point_bytes, &row, sizeof row);
  std::memcpy(record + header.point_bytes + sizeof row, &column, sizeof column);
}

// The points of an ascii or binary file.
class PcdSource : public RecordSource {
 public:
  PcdSource(std::unique_ptr<ByteStream> stream, PcdHeader header, const PcdRecord& record)
      : stream_(std::move(stream)), header_(std::move(header)), packed_(record.bytes) {
    set_layout(make_layout(stream_->path(), record));
    const bool text = header_.data == PcdData::ascii;
    std::uint64_t least = header_.point_bytes;
    if (text) {
      least = 0;
      for (const PcdField& field : header_.fields) least += 2 * field.count;
    }
    // Allow for the last line of a text, which may lack its end.
    if (header_.points > (stream_->max_left() + (text ? 1 : 0)) / least) {
      stream_->fail_at(stream_->offset(), "the PCD header counts " +
                                              std::to_string(header_.points) +
                                              " points, more than the file can hold");
    }
  }

 private:
  const std::byte* next_record() override {
    if (done_ == header_.points) return nullptr;
    if (header_.data == PcdData::ascii) {
      read_line();
    } else {
      place_ = stream_->offset();
      const std::byte* const point = stream_->take(header_.point_bytes).data();
      if (header_.height <= 1) {
        ++done_;
        return point;
      }
      std::memcpy(packed_.data(), point, header_.point_bytes);
    }
    set_grid(header_, done_++, packed_.data());
    return packed_.data();
  }

  void read_line() {
    // Find the next line that has words.
    std::string_view line;
    do {
      if (!stream_->next_line(line)) {
        stream_->fail_at_line("the file ends too early: " + std::to_string(header_.points - done_) +
                              " points are missing");
      }
      line = trimmed(line);
    } while (line.empty());

    // Store a word for each number.
    LineFields words(line);
    std::byte* to = packed_.data();
    for (const PcdField& field : header_.fields) {
      for (std::size_t i = 0; i < field.count; ++i) {
        std::string_view word;
        if (!words.next(word))
          stream_->fail_at_line("a value of field '" + field.name + "' is missing");
        if (!store_word(word, field.type, to))
          stream_->fail_at_line("a value of field '" + field.name + "' is not of its type");
        to += channel_bytes(field.type);
      }
    }
    std::string_view word;
    if (words.next(word)) stream_->fail_at_line("the line has more values than the PCD has fields");
  }

  void finish_block() override {
    if (done_ < header_.points) return;
    if (header_.data == PcdData::binary) {
      const std::string_view rest = stream_->peek(kMaxPadding + 1);
      if (!is_padding(std::as_bytes(std::span(rest))))
        stream_->fail_at(stream_->offset(), kMoreData);
      return;
    }
    std::string_view line;
    while (stream_->next_line(line)) {
      if (!trimmed(line).empty()) stream_->fail_at_line(kMoreData);
    }
  }

  void fail_record(const std::string& rule) const override {
    if (header_.data == PcdData::ascii) stream_->fail_at_line(rule);
    stream_->fail_at(place_, rule);
  }

  std::unique_ptr<ByteStream> stream_;
  PcdHeader header_;
  std::vector<std::byte> packed_;  // a point of a text or a grid
  std::uint64_t place_ = 0;        // offset of the binary point that was read last
  std::uint64_t done_ = 0;         // points that were read
};

// The points of a compressed file.
class PcdCompressedSource : public ColumnSource {
 public:
  PcdCompressedSource(const ByteStream& header_stream, std::uint64_t offset, std::uint64_t bytes,
                      PcdHeader header, const PcdRecord& record)
      : file_(header_stream.path()), offset_(offset), header_(std::move(header)) {
    set_layout(make_layout(file_.path(), record));
    std::array<std::byte, kMaxPadding + 1> rest{};
    const std::uint64_t end = offset + bytes;
    const auto some =
        static_cast<std::size_t>(std::min<std::uint64_t>(rest.size(), file_.size() - end));
    file_.read_at(end, std::span(rest).first(some));
    if (!is_padding(std::span(rest).first(some))) fail(end, kMoreData);

    // Decompress everything once; remember the beginning of each field.
    LzfReader reader(file_, offset, bytes);
    std::vector<Column> columns;
    std::size_t at = 0;
    std::vector<std::byte> scratch(std::size_t{1} << 16);
    for (const PcdField& field : header_.fields) {
      readers_.push_back(reader);
      columns.push_back({field.bytes(), at});
      at += field.bytes();
      std::uint64_t left = header_.points * field.bytes();
      while (left > 0) {
        const auto part = static_cast<std::size_t>(std::min<std::uint64_t>(left, scratch.size()));
        reader.read(std::span(scratch).first(part));
        left -= part;
      }
    }
    if (!reader.at_end()) fail(offset, "damaged LZF data: they go on behind the last point");
    set_columns(std::move(columns), record.bytes, header_.points);
  }

 private:
  void read_column(std::size_t column, std::uint64_t /*first*/, std::span<std::byte> out) override {
    readers_[column].read(out);
  }
  void complete(std::uint64_t index, std::byte* record) override {
    set_grid(header_, index, record);
  }
  void fail_record(const std::string& rule) const override { fail(offset_, rule); }
  [[noreturn]] void fail(std::uint64_t offset, const std::string& rule) const {
    refuse_file(file_.path(), "offset " + std::to_string(offset) + ": " + rule);
  }

  InputFile file_;
  std::uint64_t offset_;  // of the compressed data
  PcdHeader header_;
  std::vector<LzfReader> readers_;  // by field
};

std::unique_ptr<PointSource> open_compressed(ByteStream& stream, PcdHeader header,
                                             const PcdRecord& record) {
  if (stream.compressed()) {
    refuse_file(stream.path(), "compressed PCD inside gzip is not supported: unpack the gzip file");
  }
  const auto packed = load<std::uint32_t>(stream.take(4).data(), 0);
  const auto bytes = load<std::uint32_t>(stream.take(4).data(), 0);
  const std::uint64_t offset = stream.offset();
  if (packed > stream.max_left()) stream.fail_at(offset - 8, "the LZF data end too early");
  if (header.points > bytes / header.point_bytes || header.points * header.point_bytes != bytes)
    stream.fail_at(offset - 4, "the LZF data have another size than the points of the header");
  if (bytes / LzfReader::kMaxRatio > packed)
    stream.fail_at(offset - 8, "the LZF data cannot stand for so many bytes");
  return std::make_unique<PcdCompressedSource>(stream, offset, packed, std::move(header), record);
}

// Adds what the file says of its scanner.
void add_viewpoint(const PcdHeader& header, PointFileInfo& info) {
  if (!header.viewpoint) return;
  info.text.emplace(kPcdViewpoint, fmt::format("{}", fmt::join(*header.viewpoint, " ")));
  const glm::dvec3 position((*header.viewpoint)[0], (*header.viewpoint)[1], (*header.viewpoint)[2]);
  if (header.height > 1 || position != glm::dvec3(0)) info.scanners.push_back(position);
}

}  // namespace

PointFile open_pcd(const std::filesystem::path& path) {
  auto stream = std::make_unique<ByteStream>(path);
  PcdHeader header = read_pcd_header(*stream);
  const PcdRecord record = describe_record(header);

  PointFile file;
  make_layout(path, record).describe(file.info);
  file.info.count = header.points;
  file.info.text.emplace("up", "z");
  file.info.notes = record.notes;
  add_viewpoint(header, file.info);
  if (header.data == PcdData::compressed) {
    file.source = open_compressed(*stream, std::move(header), record);
  } else {
    file.source = std::make_unique<PcdSource>(std::move(stream), std::move(header), record);
  }
  return file;
}

}  // namespace ptc
