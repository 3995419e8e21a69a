// Words and numbers in lines of text, and endings of file names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace ptc {

/// The characters that are white space within a line.
inline constexpr std::string_view kBlanks = " \t\r\v\f";

/// Splits a line into words, which are separated by white space. All views refer to the line.
class Words {
 public:
  explicit Words(std::string_view line) noexcept : rest_(line) {}

  /// Returns the next word, or an empty view at the end of the line.
  [[nodiscard]] std::string_view next() noexcept;
  /// Returns the part of the line behind the words that next() returned, without white space at its
  /// ends.
  [[nodiscard]] std::string_view rest() const noexcept;

 private:
  std::string_view rest_;
};

/// Parses a decimal number, "nan" or "inf", in any case and without regard to the locale. A number
/// that is too large gives infinity, one that is too small gives zero.
/// @return nothing when the word is not exactly one number
[[nodiscard]] std::optional<double> parse_number(std::string_view word) noexcept;
/// Parses a decimal integer. @return nothing when the word is not exactly one integer of 64 bits
[[nodiscard]] std::optional<std::int64_t> parse_integer(std::string_view word) noexcept;

/// Returns the extension of a file name in lower case with its dot, or an empty string.
[[nodiscard]] std::string lower_extension(const std::filesystem::path& path);

}  // namespace ptc
