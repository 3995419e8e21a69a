// Reads clouds from PTS text: blocks of a count and that many points.
//
//   3                        the points of the block
//   1.5 2 3 -1024 97 59 38   x y z [intensity] [r g b], the same for all points of the file
//   ...

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/cloud/text_fields.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

// Reads the next line that is not blank. Returns false at the end of the file.
bool next_text(ByteStream& stream, std::string_view& text) {
  std::string_view line;
  do {
    if (!stream.next_line(line)) return false;
    text = trimmed(line);
  } while (text.empty());
  return true;
}

std::size_t count_fields(std::string_view text) {
  std::size_t count = 0;
  LineFields fields(text);
  for (std::string_view field; fields.next(field);) ++count;
  return count;
}

std::uint64_t read_count(ByteStream& stream, std::string_view text) {
  const std::optional<std::int64_t> count = parse_integer(text);
  if (!count || *count < 0) {
    stream.fail_at_line("a block of PTS must begin with the number of its points, alone on a line");
  }
  return static_cast<std::uint64_t>(*count);
}

// Returns the number of values of the first point; 3 when the file has none.
std::size_t count_columns(const std::filesystem::path& path) {
  ByteStream stream(path);
  std::string_view text;
  std::uint64_t points = 0;
  while (points == 0) {
    if (!next_text(stream, text)) return 3;
    points = read_count(stream, text);
  }
  if (!next_text(stream, text)) return 3;
  const std::size_t count = count_fields(text);
  if (count != 3 && count != 4 && count != 6 && count != 7) {
    stream.fail_at_line(std::to_string(count) + " values, but lines of PTS have 3, 4, 6 or 7");
  }
  return count;
}

std::vector<RecordField> pts_fields(std::size_t columns) {
  std::vector<RecordField> fields;
  std::size_t offset = 0;
  const auto add = [&](std::initializer_list<const char*> names, ChannelType type) {
    for (const char* name : names) {
      fields.push_back(make_field(name, type, offset));
      offset += channel_bytes(type);
    }
  };
  add({"x", "y", "z"}, ChannelType::f64);
  if (columns == 4 || columns == 7) add({"intensity"}, ChannelType::f32);
  if (columns >= 6) add({"red", "green", "blue"}, ChannelType::u8);
  return fields;
}

class PtsSource : public RecordSource {
 public:
  explicit PtsSource(const std::filesystem::path& path)
      : fields_(pts_fields(count_columns(path))), stream_(path) {
    packed_.resize(fields_.back().offset + fields_.back().channel.component_bytes());
    set_layout(PointLayout(path, fields_, {.owner = "the PTS points"}));
  }

  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    layout().describe(info);
    info.text.emplace("up", "z");
    return info;
  }

 private:
  const std::byte* next_record() override {
    std::string_view text;
    while (left_ == 0) {
      if (!next_text(stream_, text)) return nullptr;
      left_ = read_count(stream_, text);
    }
    if (!next_text(stream_, text)) {
      stream_.fail_at_line("the file ends too early: " + std::to_string(left_) +
                           " points of the block are missing");
    }
    --left_;
    std::size_t count = 0;
    LineFields words(text);
    for (std::string_view word; words.next(word); ++count) {
      if (count == fields_.size()) stream_.fail_at_line("the line has more values than the first");
      const RecordField& field = fields_[count];
      if (!store_word(word, field.channel.type, packed_.data() + field.offset)) {
        stream_.fail_at_line("the value of " + field.channel.name +
                             (field.channel.type == ChannelType::u8 ? " is not an integer up to 255"
                                                                    : " is not a number"));
      }
    }
    if (count < fields_.size()) stream_.fail_at_line("the line has fewer values than the first");
    return packed_.data();
  }

  void fail_record(const std::string& rule) const override { stream_.fail_at_line(rule); }

  std::vector<RecordField> fields_;
  ByteStream stream_;
  std::vector<std::byte> packed_;  // the point that was read last
  std::uint64_t left_ = 0;         // points of the block that were not read yet
};

}  // namespace

PointFile open_pts(const std::filesystem::path& path) {
  return open_source<PtsSource>(path);
}

}  // namespace ptc
