// Values of options, checked while they are parsed.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

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

/// Says that an option expects something else. @throws CLI::ValidationError, as all of these
[[noreturn]] void refuse(const std::string& option, const std::string& text,
                         const std::string& expected);

/// Finite numbers separated by commas, as many as one of `counts` says.
[[nodiscard]] std::vector<double> parse_numbers(const std::string& option, const std::string& text,
                                                std::initializer_list<std::size_t> counts,
                                                const std::string& expected);

/// Refuses what is no number from `least` to `most`.
[[nodiscard]] CLI::Validator in_range(double least, double most);
[[nodiscard]] CLI::Validator whole_in_range(std::uint64_t least, std::uint64_t most);

/// A finite number from `least` to `most`; its default is shown in the help.
template <class T>
CLI::Option* add_number(CLI::App& app, const std::string& name, T& value, double least, double most,
                        const std::string& description) {
  static_assert(std::is_floating_point_v<T>);
  return app.add_option(name, value, description)
      ->type_name("NUMBER")
      ->check(in_range(least, most))
      ->capture_default_str();
}

/// A whole number from `least` to `most`; its default is shown in the help.
template <class T>
CLI::Option* add_integer(CLI::App& app, const std::string& name, T& value, std::uint64_t least,
                         std::uint64_t most, const std::string& description) {
  static_assert(std::is_integral_v<T>);
  return app.add_option(name, value, description)
      ->type_name("N")
      ->check(whole_in_range(least, most))
      ->capture_default_str();
}

/// One of some words; the one that means the value so far is the default in the help.
template <class T>
CLI::Option* add_choice(CLI::App& app, const std::string& name, T& value,
                        const std::vector<std::pair<std::string, T>>& choices,
                        const std::string& description) {
  std::string names;
  std::string current;
  for (const auto& [text, choice] : choices) {
    names += (names.empty() ? "" : "|") + text;
    if (choice == value) current = text;
  }
  const auto set = [&value, choices, name, names](const std::string& text) {
    for (const auto& [word, choice] : choices) {
      if (word != text) continue;
      value = choice;
      return;
    }
    refuse(name, text, names);
  };
  return app.add_option_function<std::string>(name, set, description)
      ->type_name(names)
      ->default_str(current);
}

/// A whole number from 1, also with k, M or G for powers of 1000: "250k", "1.5M".
[[nodiscard]] std::uint64_t parse_count(const std::string& option, const std::string& text);
/// The same as an option.
CLI::Option* add_count(CLI::App& app, const std::string& name, std::uint64_t& count,
                       const std::string& description);

/// Bytes, also with K, M, G or T for powers of 1024: "256M", "1.5G".
[[nodiscard]] std::uint64_t parse_size(const std::string& option, const std::string& text);
/// The same as an option; the default is shown in the help.
CLI::Option* add_size(CLI::App& app, const std::string& name, std::uint64_t& bytes,
                      const std::string& description);

}  // namespace ptc
