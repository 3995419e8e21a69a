// Reads clouds from XYZ text: a point on each line, in columns that may have names.
//
// XyzLines reads lines of values; it is used twice. First for a sample, from which
// choose_xyz_columns() decides what the columns are, then from the beginning for all points:
//
//   // X Y Z R G B           names, in a comment or not, quoted or not
//   1.5 2 3 255 128 0        separators are white space, commas or semicolons
//   # a comment
#include <algorithm>
#include <memory>
#include <utility>

#include "engine/io/cloud/channel_names.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/cloud/text_fields.h"
#include "engine/io/cloud/xyz_columns.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxColumns = 256;
constexpr std::size_t kSampleLines = 100;

// Says whether these are names of columns.
bool are_names(std::span<const std::string> names) {
  const auto has = [&](const char* wanted) {
    return std::ranges::any_of(names, [&](const auto& name) { return bare_name(name) == wanted; });
  };
  return has("x") && has("y") && has("z");
}

// Returns the part of a line before a comment, and sets `comment` to the text of the comment.
std::string_view cut_comment(std::string_view line, std::string_view& comment) {
  const std::size_t at = std::min(line.find('#'), line.find("//"));
  comment = {};
  if (at == std::string_view::npos) return line;
  const std::size_t text = line.find_first_not_of("#/", at);
  if (text != std::string_view::npos) comment = line.substr(text);
  return line.substr(0, at);
}

// The lines of an XYZ file that have values, and the names of the columns.
class XyzLines {
 public:
  explicit XyzLines(const std::filesystem::path& path) : stream_(path) {}

  // Reads the next line that has values. Every line has as many as the first. Returns false at the
  // end of the file.
  bool next() {
    std::string_view line;
    while (stream_.next_line(line)) {
      if (stream_.line() == 1 && line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
      std::string_view comment;
      const std::string_view text = trimmed(cut_comment(line, comment));
      if (values_.empty() && text.empty()) read_names(comment, commented_names_);
      if (text.empty()) continue;
      if (values_.empty() && names_.empty() && read_header(text)) continue;
      read_values(text);
      return true;
    }
    return false;
  }

  [[nodiscard]] const std::vector<double>& values() const noexcept { return values_; }

  // Returns the names of the columns, after a line of values was read; empty when there are none.
  [[nodiscard]] const std::vector<std::string>& names() const noexcept {
    if (!names_.empty()) return names_;
    static const std::vector<std::string> kNone;
    return commented_names_.size() == values_.size() ? commented_names_ : kNone;
  }

  [[noreturn]] void fail(const std::string& rule) const { stream_.fail_at_line(rule); }

 private:
  static bool read_names(std::string_view text, std::vector<std::string>& names) {
    std::vector<std::string> found;
    for (const std::string_view field : unquoted_fields(text)) found.emplace_back(field);
    if (found.size() > kMaxColumns || !are_names(found)) return false;
    names = std::move(found);
    return true;
  }

  // Reads the line as names if it has no number. A line of words must be one of names.
  bool read_header(std::string_view text) {
    for (const std::string_view field : unquoted_fields(text)) {
      if (parse_number(field)) return false;
    }
    if (!read_names(text, names_)) fail("the line has neither values nor names with x, y and z");
    return true;
  }

  void read_values(std::string_view text) {
    const std::size_t expected = values_.empty() ? names_.size() : values_.size();
    values_.clear();
    LineFields fields(text);
    for (std::string_view field; fields.next(field);) {
      const std::optional<double> value = parse_number(field);
      if (!value) fail(field.empty() ? "a value is missing" : "a value is not a number");
      if (values_.size() == kMaxColumns) {
        fail("the line has more than " + std::to_string(kMaxColumns) + " values");
      }
      values_.push_back(*value);
    }
    const std::string count = std::to_string(values_.size()) + " values, but ";
    if (values_.size() < 3) fail(count + "lines of XYZ have at least x, y and z");
    if (expected != 0 && values_.size() != expected) {
      fail(count + (names_.empty() ? "the first line has " : "the line of names has ") +
           std::to_string(expected));
    }
  }

  ByteStream stream_;
  std::vector<std::string> names_;            // of a line of their own
  std::vector<std::string> commented_names_;  // of the last comment before the values that has some
  std::vector<double> values_;                // of the line that was read last
};

class XyzSource : public RecordSource {
 public:
  XyzSource(const std::filesystem::path& path, XyzColumns columns)
      : lines_(path), columns_(std::move(columns)) {
    const RecordField& last = columns_.fields.back();
    packed_.resize(last.offset + last.channel.component_bytes());
    set_layout(PointLayout(path, columns_.fields,
                           {.owner = "the columns", .float_colours = columns_.float_colours}));
  }

  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    layout().describe(info);
    info.notes = columns_.notes;
    return info;
  }

 private:
  const std::byte* next_record() override {
    if (!lines_.next()) return nullptr;
    const std::vector<double>& values = lines_.values();
    for (std::size_t i = 0; i < values.size(); ++i) {
      const RecordField& field = columns_.fields[i];
      if (!store_number(values[i], field.channel.type, packed_.data() + field.offset)) {
        lines_.fail("the colour is not an integer of " +
                    std::string(field.channel.type == ChannelType::u8 ? "8" : "16") +
                    " bits, as those of the first lines");
      }
    }
    return packed_.data();
  }

  void fail_record(const std::string& rule) const override { lines_.fail(rule); }

  XyzLines lines_;
  XyzColumns columns_;
  std::vector<std::byte> packed_;  // the line that was read last
};

}  // namespace

PointFile open_xyz(const std::filesystem::path& path) {
  XyzSample sample;
  XyzLines lines(path);
  while (sample.rows.size() < kSampleLines && lines.next()) sample.rows.push_back(lines.values());
  sample.names = lines.names();
  std::filesystem::path name = path;
  if (lower_extension(name) == ".gz") name = name.stem();
  return open_source<XyzSource>(path, choose_xyz_columns(sample, lower_extension(name) == ".xyzn"));
}

}  // namespace ptc
