// Splitting of lines.
#include "engine/io/cloud/text_fields.h"

#include "engine/io/text/text.h"

namespace ptc {

LineFields::LineFields(std::string_view line) noexcept : rest_(trimmed(line)), separator_(' ') {
  for (const char candidate : {';', ','}) {
    if (separator_ == ' ' && rest_.find(candidate) != std::string_view::npos)
      separator_ = candidate;
  }
}

bool LineFields::next(std::string_view& field) noexcept {
  if (rest_.empty()) return false;
  if (separator_ == ' ') {
    Words words(rest_);
    field = words.next();
    rest_ = words.rest();
    return true;
  }
  const std::size_t at = rest_.find(separator_);
  field = trimmed(rest_.substr(0, at));
  rest_ = at == std::string_view::npos ? std::string_view() : trimmed(rest_.substr(at + 1));
  return true;
}

std::string_view trimmed(std::string_view text) noexcept {
  return Words(text).rest();
}

std::vector<std::string_view> unquoted_fields(std::string_view line) {
  std::vector<std::string_view> fields;
  LineFields split(line);
  for (std::string_view field; split.next(field);) {
    const bool quoted = field.size() >= 2 && (field.front() == '"' || field.front() == '\'') &&
                        field.back() == field.front();
    fields.push_back(quoted ? field.substr(1, field.size() - 2) : field);
  }
  return fields;
}

}  // namespace ptc
