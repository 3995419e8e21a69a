// Options of experiments, each with the value that --quick gives it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/shade/shading.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// "SR,RAD,R[,X]": solid angle, parallax, resolution, inflation. Refuses what a gather does not
/// take.
[[nodiscard]] GatherOptions parse_setting(const std::string& text);

/// The scenes that an experiment goes through.
class SceneList {
 public:
  /// Finds them. @throws DataError for files that cannot be read, std::invalid_argument as
  /// parse_scenes()
  void check();
  /// After check().
  [[nodiscard]] const std::vector<SceneChoice>& choices() const noexcept { return choices_; }

 private:
  friend class Declaration;
  std::vector<std::string> texts_{"fractal", "window", "city"};
  std::vector<SceneChoice> choices_;
};

/// Declares options of one command. What is declared must stay where it is.
class Declaration {
 public:
  explicit Declaration(CLI::App& command) : command_(&command) {}

  [[nodiscard]] CLI::App& command() const noexcept { return *command_; }

  /// --quick sets a value, unless this option is given.
  template <class Value>
  void quick(const std::string& option, Value& value, std::type_identity_t<Value> less) {
    quick_.push_back([command = command_, option, &value, less = std::move(less)] {
      if (option.empty() || command->count(option) == 0) value = less;
    });
  }
  /// --quick sets a value that has no option.
  template <class Value>
  void quick(Value& value, std::type_identity_t<Value> less) {
    quick("", value, std::move(less));
  }
  /// Does what --quick does, once the command is parsed.
  void shorten() const;

  /// The positional arguments; --quick leaves the first of the default scenes.
  void scenes(SceneList& scenes);
  /// --points of a scene. @param shown  the default as the help has it
  void points(std::uint64_t& points, const char* shown, std::uint64_t less);
  /// --points, repeatable; ascending.
  void points(std::vector<std::uint64_t>& points, const std::string& description,
              std::vector<std::uint64_t> less);
  void checked(unsigned& checked, unsigned less);
  void repeats(unsigned& repeats, unsigned less);
  /// Any number of values, each parsed by itself; numbers are put in ascending order.
  template <class Value, class Parse>
  CLI::Option* list(const char* name, const char* type, std::vector<Value>& values,
                    const Parse& parse, const std::string& description) {
    const auto set = [&values, parse](const std::vector<std::string>& texts) {
      values.clear();
      for (const std::string& text : texts) values.push_back(parse(text));
      if constexpr (std::is_integral_v<Value>) std::ranges::sort(values);
    };
    return command_->add_option_function<std::vector<std::string>>(name, set, description)
        ->type_name(type)
        ->allow_extra_args(false);
  }
  /// Some of the words that are in `chosen`, repeatable.
  CLI::Option* words(const char* name, std::vector<std::string>& chosen, const char* description);

 private:
  CLI::App* command_;
  std::vector<std::function<void()>> quick_;
};

}  // namespace ptc::bench
