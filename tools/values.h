// Options whose values are checked while they are parsed.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "tools/option_text.h"
#include "tools/parse.h"

namespace ptc {

/// Refuses values that are not finite numbers from `least` to `most`.
[[nodiscard]] CLI::Validator in_range(double least, double most);
/// Refuses values that are not whole numbers from `least` to `most`.
[[nodiscard]] CLI::Validator whole_in_range(std::uint64_t least, std::uint64_t most);

/// Declares an option that takes a finite number from `least` to `most`. The value so far is the
/// default in the help.
template <class T>
CLI::Option* add_number(CLI::App& app, const std::string& name, T& value, double least, double most,
                        const std::string& description) {
  static_assert(std::is_floating_point_v<T>);
  return app.add_option(name, value, description)
      ->type_name("NUMBER")
      ->check(in_range(least, most))
      ->capture_default_str();
}

/// Declares an option that takes a whole number from `least` to `most`. The value so far is the
/// default in the help.
template <class T>
CLI::Option* add_integer(CLI::App& app, const std::string& name, T& value, std::uint64_t least,
                         std::uint64_t most, const std::string& description) {
  static_assert(std::is_integral_v<T>);
  return app.add_option(name, value, description)
      ->type_name("N")
      ->check(whole_in_range(least, most))
      ->capture_default_str();
}

/// Declares an option that takes one of some words. The word for the value so far is the default in
/// the help; shells propose all of them.
template <class T>
CLI::Option* add_choice(CLI::App& app, const std::string& name, T& value,
                        const std::vector<std::pair<std::string, T>>& choices,
                        const std::string& description) {
  std::vector<std::string> words;
  std::string current;
  for (const auto& [text, choice] : choices) {
    words.push_back(text);
    if (choice == value) current = text;
  }
  const auto set = [&value, choices, name, words](const std::string& text) {
    for (const auto& [word, choice] : choices) {
      if (word != text) continue;
      value = choice;
      return;
    }
    refuse(name, text, join(words, "|"));
  };
  return offer(app.add_option_function<std::string>(name, set, description), words)
      ->type_name("NAME")
      ->default_str(current);
}

/// Declares an option that takes a count as parse_count() does.
CLI::Option* add_count(CLI::App& app, const std::string& name, std::uint64_t& count,
                       const std::string& description);

/// Declares an option that takes a size as parse_size() does. The value so far is the default in
/// the help.
CLI::Option* add_size(CLI::App& app, const std::string& name, std::uint64_t& bytes,
                      const std::string& description);

}  // namespace ptc
