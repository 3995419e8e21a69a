#include "tools/parse.h"

#include <algorithm>
#include <map>
#include <utility>

#include <CLI/Error.hpp>

namespace ptc {
namespace {

/// The number that a text spells, times the factor of its suffix if it has one; NaN when the text
/// is no number or the suffix is unknown.
double parse_scaled(std::string_view text, const std::map<std::string_view, double>& suffixes) {
  const std::size_t end = unit_begin(text);
  const auto number = parse_number<double>(text.substr(0, end));
  const auto factor = suffixes.find(text.substr(end));
  const bool known = end == text.size() || factor != suffixes.end();
  if (!number || !known) return std::nan("");
  return end == text.size() ? *number : *number * factor->second;
}

}  // namespace

void refuse(const std::string& option, const std::string& text, const std::string& expected) {
  throw CLI::ValidationError(option, "expects " + expected + ", not '" + text + "'");
}

std::optional<std::vector<double>> split_numbers(std::string_view text) {
  std::vector<double> numbers;
  while (true) {
    const std::size_t comma = text.find(',');
    const auto number = parse_number<double>(text.substr(0, comma));
    if (!number) return {};
    numbers.push_back(*number);
    if (comma == std::string_view::npos) return numbers;
    text.remove_prefix(comma + 1);
  }
}

std::vector<double> parse_numbers(const std::string& option, const std::string& text,
                                  std::initializer_list<std::size_t> counts,
                                  const std::string& expected) {
  auto numbers = split_numbers(text);
  if (!numbers || std::ranges::find(counts, numbers->size()) == counts.end()) {
    refuse(option, text, expected);
  }
  return *std::move(numbers);
}

std::size_t unit_begin(std::string_view text) {
  return text.find_last_of("0123456789.") + 1;
}

std::uint64_t parse_count(const std::string& option, const std::string& text) {
  constexpr double kMax = 0x1p48;  // points of a file
  const double count = parse_scaled(text, {{"k", 1e3}, {"K", 1e3}, {"M", 1e6}, {"G", 1e9}});
  const double whole = std::rint(count);
  // 4.1 * 1e6 is 4099999.9999999995: the product of a fraction and a suffix is rounded twice.
  const bool is_whole = std::abs(count - whole) <= whole * 0x1p-50;
  if (!is_whole || !(whole >= 1 && whole <= kMax)) {
    refuse(option, text, "a whole number from 1 to 2^48, such as 250000, 250k or 1.5M");
  }
  return static_cast<std::uint64_t>(whole);
}

std::uint64_t parse_size(const std::string& option, const std::string& text) {
  constexpr double kMax = 0x1p62;
  const double bytes = parse_scaled(text, {{"K", 0x1p10},
                                           {"M", 0x1p20},
                                           {"G", 0x1p30},
                                           {"T", 0x1p40},
                                           {"KiB", 0x1p10},
                                           {"MiB", 0x1p20},
                                           {"GiB", 0x1p30},
                                           {"TiB", 0x1p40}});
  if (!(bytes >= 1 && bytes <= kMax))
    refuse(option, text, "a size such as 800000000, 256M or 1.5G");
  return static_cast<std::uint64_t>(bytes);
}

}  // namespace ptc
