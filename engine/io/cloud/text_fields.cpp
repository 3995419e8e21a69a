// Splitting of lines.
#include "engine/io/cloud/text_fields.h"

#include <string>

#include "engine/io/text/text.h"

namespace ptc {

namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";

/// Returns the place of the first of some characters that stands outside of double quotes; npos
/// when there is none.
std::size_t find_unquoted(std::string_view text, std::string_view characters) noexcept {
  std::size_t at = text.find_first_of(characters);
  if (at == text.npos || text.substr(0, at).find('"') == text.npos) return at;
  bool quoted = false;
  for (at = 0; at < text.size(); ++at) {
    if (text[at] == '"') quoted = !quoted;
    if (!quoted && characters.find(text[at]) != characters.npos) return at;
  }
  return text.npos;
}

}  // namespace

LineFields::LineFields(std::string_view line) noexcept : rest_(trimmed(line)), separator_(' ') {
  for (const char candidate : {';', ','}) {
    if (separator_ == ' ' && find_unquoted(rest_, {&candidate, 1}) != std::string_view::npos)
      separator_ = candidate;
  }
}

bool LineFields::next(std::string_view& field) noexcept {
  if (rest_.empty()) return false;
  const std::size_t at =
      find_unquoted(rest_, separator_ == ' ' ? kBlanks : std::string_view(&separator_, 1));
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
