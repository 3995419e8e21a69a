// Numbers from the text of an option, and the error for text that is none.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace ptc {

/// The number that the whole of `text` spells; empty when it spells none, or none that is finite.
template <class T>
[[nodiscard]] std::optional<T> parse_number(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return {};
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(value)) return {};
  }
  return value;
}

/// Refuses the value of an option: "--sun: expects ..., not '...'".
/// @throws CLI::ValidationError always, as every check of this file does when a value is wrong
[[noreturn]] void refuse(const std::string& option, const std::string& text,
                         const std::string& expected);

/// The finite numbers of a text, separated by commas; empty when a part of it is none.
[[nodiscard]] std::optional<std::vector<double>> split_numbers(std::string_view text);

/// Finite numbers separated by commas. Refuses a list whose length is none of `counts`.
[[nodiscard]] std::vector<double> parse_numbers(const std::string& option, const std::string& text,
                                                std::initializer_list<std::size_t> counts,
                                                const std::string& expected);

/// Where the unit or the suffix at the end of a text begins: behind its last digit.
[[nodiscard]] std::size_t unit_begin(std::string_view text);

/// A whole number from 1 to 2^48, with k, M or G for powers of 1000 or without: "250k", "1.5M".
[[nodiscard]] std::uint64_t parse_count(const std::string& option, const std::string& text);
/// A number of bytes, with K, M, G or T for powers of 1024 or without: "256M", "1.5G".
[[nodiscard]] std::uint64_t parse_size(const std::string& option, const std::string& text);

}  // namespace ptc
