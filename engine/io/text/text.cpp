// Words of a line, and numbers that do not depend on the locale.
#include "engine/io/text/text.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <limits>
#include <system_error>

#include "engine/io/file/url.h"

namespace ptc {
namespace {

// Removes a plus sign from the front of a number, because std::from_chars does not accept one.
std::string_view without_plus(std::string_view word) noexcept {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-' && word[1] != '+') word.remove_prefix(1);
  return word;
}

}  // namespace

std::string_view Words::next() noexcept {
  const char* at = rest_.data();
  const char* const end = at + rest_.size();
  const auto blank = [](char c) { return c == ' ' || (c >= '\t' && c <= '\r'); };
  while (at != end && blank(*at)) ++at;
  const char* const begin = at;
  while (at != end && !blank(*at)) ++at;
  rest_ = {at, static_cast<std::size_t>(end - at)};
  return {begin, static_cast<std::size_t>(at - begin)};
}

std::string_view Words::rest() const noexcept {
  const std::size_t begin = rest_.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return rest_.substr(begin, rest_.find_last_not_of(kBlanks) - begin + 1);
}

std::optional<double> parse_number(std::string_view word) noexcept {
  word = without_plus(word);
  double value = 0;
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (stop != end || error == std::errc::invalid_argument) return std::nullopt;
  if (error == std::errc::result_out_of_range) {  // std::from_chars leaves `value` as it was
    const bool tiny =
        word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos;
    value = tiny ? 0 : std::numeric_limits<double>::infinity();
    return word[0] == '-' ? -value : value;
  }
  return value;
}

std::optional<std::int64_t> parse_integer(std::string_view word) noexcept {
  word = without_plus(word);
  std::int64_t value = 0;
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (stop != end || error != std::errc()) return std::nullopt;
  return value;
}

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = std::filesystem::path(file_name(path)).extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace ptc
