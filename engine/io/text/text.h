// Words and numbers in lines of text; file name endings; text that is shown.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace ptc {

/// The words of a line, separated by blanks and tabs.
class Words {
 public:
  explicit Words(std::string_view line) noexcept : rest_(line) {}

  /// The next word, empty at the end.
  [[nodiscard]] std::string_view next() noexcept;
  /// What follows the words taken so far, without blanks at its ends.
  [[nodiscard]] std::string_view rest() const noexcept;

 private:
  std::string_view rest_;
};

/// A decimal number, "nan" or "inf"; too large a number is an infinity, too small a one zero.
[[nodiscard]] std::optional<double> parse_number(std::string_view word) noexcept;
[[nodiscard]] std::optional<std::int64_t> parse_integer(std::string_view word) noexcept;

/// The ending of a file name in lower case, with its dot.
[[nodiscard]] std::string lower_extension(const std::filesystem::path& path);

/// Text that may hold bytes of a file, fit for a terminal: control characters but '\n' become \xNN,
/// and so do all bytes beyond ASCII when they are not UTF-8.
[[nodiscard]] std::string printable(std::string_view text);

}  // namespace ptc
