// Splitting of lines.
#include "engine/io/cloud/text_fields.h"

#include <string>

#include "engine/io/text/text.h"

namespace ptc {

namespace {

/// Returns the place of the first of some characters that stands outside of double quotes; npos
/// when there is none.
std::size_t find_unquoted(std::string_view text, std::string_view characters) noexcept {
  bool quoted = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (text[at] == '"') quoted = !quoted;
    if (!quoted && characters.find(text[at]) != characters.npos) return at;
  }
  return text.npos;
}

}  // namespace

LineFields::LineFields(std::string_view line) noexcept
    : rest_(trimmed(line)), separator_(' '), quotes_(rest_.find('"') != rest_.npos) {
  for (const char candidate : {';', ','}) {
    if (separator_ == ' ' && find(candidate) != rest_.npos) separator_ = candidate;
  }
}

std::size_t LineFields::find(char separator) const noexcept {
  return quotes_ ? find_unquoted(rest_, {&separator, 1}) : rest_.find(separator);
}

bool LineFields::next(std::string_view& field) noexcept {
  if (rest_.empty()) return false;
  if (separator_ == ' ' && !quotes_) {  // most lines of most files
    Words words(rest_);
    field = words.next();
    rest_ = words.rest();
    return true;
  }
  const std::size_t at = separator_ == ' ' ? find_unquoted(rest_, kBlanks) : find(separator_);
  field = trimmed(rest_.substr(0, at));
  rest_ = at == std::string_view::npos ? std::string_view() : trimmed(rest_.substr(at + 1));
  return true;
}

bool has_decimal_comma(std::string_view field) {
  const std::size_t comma = field.find(',');
  if (comma == field.npos) return false;
  std::string number(field);
  number[comma] = '.';
  return parse_number(number).has_value();
}

std::string_view trimmed(std::string_view text) noexcept {
  return Words(text).rest();
}

std::string_view unquoted(std::string_view field) noexcept {
  const bool quoted = field.size() >= 2 && (field.front() == '"' || field.front() == '\'') &&
                      field.back() == field.front();
  return quoted ? field.substr(1, field.size() - 2) : field;
}

std::vector<std::string_view> unquoted_fields(std::string_view line) {
  std::vector<std::string_view> fields;
  LineFields split(line);
  for (std::string_view field; split.next(field);) fields.push_back(unquoted(field));
  return fields;
}

}  // namespace ptc
