// Internal to the readers of clouds in text: the fields of a line.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

namespace ptc {

/// Splits a line into fields: at semicolons if it has any, else at commas if it has any, else at
/// white space. White space around fields is no part of them, and neither is one separator at the
/// end of the line. What stands in double quotes separates nothing. All views refer to the line.
class LineFields {
 public:
  explicit LineFields(std::string_view line) noexcept;
  /// Sets `field` to the next field, which may be empty between separators.
  /// @return false at the end of the line
  [[nodiscard]] bool next(std::string_view& field) noexcept;

 private:
  [[nodiscard]] std::size_t find(char separator) const noexcept;

  std::string_view rest_;
  char separator_;  // ' ' stands for white space
  bool quotes_;     // the line has double quotes
};

/// Says whether a field is a number that has a comma in place of its point, such as "1,5".
[[nodiscard]] bool has_decimal_comma(std::string_view field);

/// Returns a text without white space at its ends.
[[nodiscard]] std::string_view trimmed(std::string_view text) noexcept;

/// Returns a field without the quotation marks around it, if it has some.
[[nodiscard]] std::string_view unquoted(std::string_view field) noexcept;

/// Returns all fields of a line, without the quotation marks around them.
[[nodiscard]] std::vector<std::string_view> unquoted_fields(std::string_view line);

}  // namespace ptc
