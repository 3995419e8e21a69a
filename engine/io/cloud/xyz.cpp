// Reads clouds from XYZ text: a point on each line, in columns that may have names.
//
// XyzLines reads lines of values; it is used twice. First for a sample, from which
// choose_xyz_columns() decides what the columns are, then from the beginning for all points:
//
//   // X Y Z R G B           names, in a comment or not, quoted or not
//   1.5 2 3 255 128 0        separators are white space, commas or semicolons
//   # a comment
//
// A column in which no line of the sample has a number is one of text. It is left out.
#include <algorithm>
#include <limits>
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
  // Reads lines as a sample: fields that are no numbers become NaN.
  explicit XyzLines(const std::filesystem::path& path) : stream_(path), sampling_(true) {}
  // Reads lines whose fields are numbers, except in columns of text, which are left out.
  XyzLines(const std::filesystem::path& path, std::vector<bool> text)
      : stream_(path), sampling_(false), text_(std::move(text)) {}

  // Reads the next line that has values. Every line has as many as the first. Returns false at the
  // end of the file.
  bool next() {
    std::string_view line;
    while (stream_.next_line(line)) {
      if (stream_.line() == 1 && line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
      std::string_view comment;
      const std::string_view text = trimmed(cut_comment(line, comment));
      if (columns_ == 0 && text.empty()) read_names(comment, commented_names_);
      if (text.empty()) continue;
      if (columns_ == 0 && names_.empty() && read_header(text)) continue;
      read_values(text);
      return true;
    }
    return false;
  }

  [[nodiscard]] const std::vector<double>& values() const noexcept { return values_; }

  // Returns the columns that had no number in any line of the sample, those of positions excepted.
  [[nodiscard]] std::vector<bool> text_columns() const {
    std::vector<bool> text = words_;
    for (std::size_t i = 0; i < text.size(); ++i) {
      const std::string name = i < names().size() ? bare_name(names()[i]) : "";
      if (names().empty() ? i < 3 : name == "x" || name == "y" || name == "z") text[i] = false;
    }
    return text;
  }

  // Returns the names of all columns, after a line of values was read; empty when there are none.
  [[nodiscard]] const std::vector<std::string>& names() const noexcept {
    if (!names_.empty()) return names_;
    static const std::vector<std::string> kNone;
    return commented_names_.size() == columns_ ? commented_names_ : kNone;
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
      if (parse_number(field) || has_decimal_comma(field)) return false;
    }
    if (!read_names(text, names_)) fail("the line has neither values nor names with x, y and z");
    return true;
  }

  [[nodiscard]] bool is_text(std::size_t column) const {
    return column < text_.size() && text_[column];
  }

  void read_values(std::string_view text) {
    // Read the fields
    const std::size_t expected = columns_ == 0 ? names_.size() : columns_;
    values_.clear();
    std::size_t column = 0;
    LineFields fields(text);
    for (std::string_view field; fields.next(field); ++column) {
      if (column == kMaxColumns)
        fail("the line has more than " + std::to_string(kMaxColumns) + " values");
      if (!is_text(column)) add_value(text, field, column);
    }
    // An empty field at the end has only the separator before it
    const bool ends_empty = column + 1 == expected && (text.back() == ';' || text.back() == ',');
    if (ends_empty && (sampling_ || is_text(column))) {
      if (sampling_) add_value(text, "", column);
      ++column;
    }
    // Check their number
    if (expected != 0 && column != expected) refuse_decimal_commas(text);
    const std::string count = std::to_string(column) + " values, but ";
    if (column < 3) fail(count + "lines of XYZ have at least x, y and z");
    if (expected != 0 && column != expected) {
      fail(count + (names_.empty() ? "the first line has " : "the line of names has ") +
           std::to_string(expected));
    }
    columns_ = column;
  }

  void add_value(std::string_view text, std::string_view field, std::size_t column) {
    const std::optional<double> value = parse_number(unquoted(field));
    if (sampling_) {
      if (column == words_.size()) words_.push_back(true);
      if (value || has_decimal_comma(unquoted(field))) words_[column] = false;
    } else if (!value) {
      refuse_field(text, field, column);
    }
    values_.push_back(value.value_or(std::numeric_limits<double>::quiet_NaN()));
  }

  // Refuses the line if its numbers have decimal commas. They stand between semicolons, in quotes,
  // or between white space, where the commas seem to separate fields.
  void refuse_decimal_commas(std::string_view text) const {
    bool commas = false, numbers = true;
    const bool separated = text.find_first_of(";\"") != std::string_view::npos;
    LineFields fields(text);
    Words words(text);
    std::string_view field;
    while (separated ? fields.next(field) : !(field = words.next()).empty()) {
      if (has_decimal_comma(unquoted(field))) {
        commas = true;
      } else {
        numbers = numbers && parse_number(field);
      }
    }
    if (!commas || !(numbers || separated)) return;
    fail(
        "numbers with a decimal comma are not read: write points in place of the commas, as sed -E "
        "'s/([0-9]),([0-9])/\\1.\\2/g' does");
  }

  [[noreturn]] void refuse_field(std::string_view text, std::string_view field,
                                 std::size_t column) const {
    constexpr std::size_t kMaxLetters = 40;
    const std::string place = "column " + std::to_string(column + 1) + ": ";
    if (field.empty()) fail(place + "a value is missing");
    refuse_decimal_commas(text);
    const std::string shown(field.substr(0, kMaxLetters));
    fail(place + "'" + shown + "' is not a number");
  }

  ByteStream stream_;
  bool sampling_;
  std::vector<bool> text_;                    // by column: it is one of text and left out
  std::vector<bool> words_;                   // by column: no line of the sample has a number there
  std::vector<std::string> names_;            // of a line of their own
  std::vector<std::string> commented_names_;  // of the last comment before the values that has some
  std::size_t columns_ = 0;                   // of a line, columns of text among them
  std::vector<double> values_;                // of the line that was read last
};

class XyzSource : public RecordSource {
 public:
  XyzSource(const std::filesystem::path& path, std::vector<bool> text, XyzColumns columns)
      : lines_(path, std::move(text)), columns_(std::move(columns)) {
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

// Removes what stands in columns of text.
template <class T>
void leave_out(const std::vector<bool>& text, std::vector<T>& columns) {
  std::size_t i = 0;
  std::erase_if(columns, [&](const T&) { return text[i++]; });
}

// Notes which columns are left out.
void note_text(const std::vector<bool>& text, const std::vector<std::string>& names,
               std::vector<std::string>& notes) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!text[i]) continue;
    notes.push_back("Column " + std::to_string(i + 1) +
                    (names.empty() ? "" : ", '" + names[i] + "',") +
                    " has no numbers and is left out.");
  }
}

}  // namespace

PointFile open_xyz(const std::filesystem::path& path) {
  // Read the first lines, and tell columns of text from those of numbers
  XyzSample sample;
  XyzLines lines(path);
  while (sample.rows.size() < kSampleLines && lines.next()) sample.rows.push_back(lines.values());
  const std::vector<bool> text = lines.text_columns();
  XyzLines checked(path, text);
  for (std::size_t i = 0; i < sample.rows.size(); ++i) static_cast<void>(checked.next());

  // Choose the columns
  sample.names = lines.names();
  std::vector<std::string> notes;
  note_text(text, sample.names, notes);
  if (!sample.names.empty() && !text.empty()) leave_out(text, sample.names);
  for (std::vector<double>& row : sample.rows) leave_out(text, row);
  std::filesystem::path name = path;
  if (lower_extension(name) == ".gz") name = name.stem();
  XyzColumns columns = choose_xyz_columns(sample, lower_extension(name) == ".xyzn");
  columns.notes.insert(columns.notes.begin(), notes.begin(), notes.end());
  return open_source<XyzSource>(path, text, std::move(columns));
}

}  // namespace ptc
