// Options of experiments, each with the value that --quick gives it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/shade/shading.h"
#include "tools/bench/scenes/bench_scene.h"

namespace CLI {
class App;  // of a header that takes seconds to compile, and that no experiment needs
}

namespace ptc::bench {

/// Parses "SR,RAD,R[,X]": solid angle, parallax, resolution, inflation.
/// @throws CLI::ValidationError for values that a gather does not accept
[[nodiscard]] GatherOptions parse_setting(const std::string& text);

/// The scenes that an experiment goes through.
class SceneList {
 public:
  SceneList() = default;
  /// @param texts  the default scenes
  explicit SceneList(std::vector<std::string> texts) : texts_(std::move(texts)) {}

  /// Parses the list and checks that its files can be read.
  /// @throws DataError for a file that cannot be read; RequestError as parse_scenes()
  void check();
  /// As check(), for an experiment that draws points from meshes.
  /// @throws DataError for a cloud, too
  void check_meshes();
  /// Makes check() take all files as one scene.
  void join() noexcept { joined_ = true; }
  /// The scenes in the order of the command line. @pre check() was called
  [[nodiscard]] const std::vector<SceneChoice>& choices() const noexcept { return choices_; }

 private:
  friend class Declaration;
  std::vector<std::string> texts_{"fractal", "window", "city"};
  std::vector<SceneChoice> choices_;
  bool joined_ = false;
};

/// Declares the options of one command. The variables that options set must outlive the parsing.
class Declaration {
 public:
  explicit Declaration(CLI::App& command) : command_(&command) {}

  [[nodiscard]] CLI::App& command() const noexcept { return *command_; }

  /// Makes --quick set a value, unless the option that sets it is given, too.
  template <class Value>
  void quick(const std::string& option, Value& value, std::type_identity_t<Value> less) {
    quick_.push_back([command = command_, option, &value, less = std::move(less)] {
      if (!is_given(*command, option)) value = less;
    });
  }
  /// Makes --quick set a value that has no option.
  template <class Value>
  void quick(Value& value, std::type_identity_t<Value> less) {
    quick("", value, std::move(less));
  }
  /// Sets all values of --quick. @pre the command is parsed
  void shorten() const;

  /// Declares the scenes as positional arguments; with --quick the default is the first scene
  /// alone.
  void scenes(SceneList& scenes);
  /// Declares --join, which makes one scene of several files.
  void joinable(SceneList& scenes);
  /// Declares --points of a scene.
  /// @param shown  the default as the help shows it
  /// @param less   the value of --quick
  void points(std::uint64_t& points, const char* shown, std::uint64_t less);
  /// Declares a repeatable --points, whose values are put in ascending order.
  /// @param less  the values of --quick
  void points(std::vector<std::uint64_t>& points, const char* description,
              std::vector<std::uint64_t> less);
  /// Declares --points of the city.
  /// @param shown  the default as the help shows it
  /// @param less   the value of --quick
  void city_points(std::uint64_t& points, const char* shown, std::uint64_t less);
  /// Declares --receivers, the number of receivers in blocks of neighbours.
  /// @param shown  the default as the help shows it
  /// @param less   the value of --quick
  void block_receivers(std::uint64_t& receivers, const char* shown, std::uint64_t less);
  /// Declares --checked, the number of receivers whose error is measured.
  /// @param less  the value of --quick
  void checked(unsigned& checked, unsigned less);
  /// Declares --repeats, the number of runs.
  /// @param less  the value of --quick
  void repeats(unsigned& repeats, unsigned less);
  /// Declares a count, which may have a suffix, as parse_count() takes it.
  /// @param shown  the default as the help shows it; empty: it shows none
  void count(const char* name, std::uint64_t& value, const char* description, const char* shown);
  /// Declares a whole number from `least` to `most`.
  void integer(const char* name, unsigned& value, std::uint64_t least, std::uint64_t most,
               const char* description);
  /// Declares a whole number from `least` to `most`.
  void integer(const char* name, std::uint64_t& value, std::uint64_t least, std::uint64_t most,
               const char* description);
  /// Declares a finite number from `least` to `most`.
  /// @param unit  the word for it in the help
  void number(const char* name, const char* unit, float& value, double least, double most,
              const char* description);
  /// Declares the name of a file.
  void file(const char* name, std::filesystem::path& value, const char* description);
  /// Declares a repeatable option whose values replace the default ones. Integers are put in
  /// ascending order.
  /// @param parse  makes a value of the text of one option, or throws CLI::ValidationError
  template <class Value, class Parse>
  void list(const char* name, const char* type, std::vector<Value>& values, const Parse& parse,
            const char* description) {
    const auto set = [&values, parse](const std::vector<std::string>& texts) {
      values.clear();
      for (const std::string& text : texts) values.push_back(parse(text));
      if constexpr (std::is_integral_v<Value>) std::ranges::sort(values);
    };
    repeatable(name, type, set, description);
  }
  /// Declares a repeatable option that chooses some of the words that `chosen` holds.
  void words(const char* name, std::vector<std::string>& chosen, const char* description);
  /// Declares the names of any number of files as positional arguments.
  void files(std::vector<std::filesystem::path>& values, const char* description);
  /// Puts an option under the heading of those that most users never need.
  void for_experts(const char* name);

 private:
  [[nodiscard]] static bool is_given(const CLI::App& command, const std::string& option);
  void repeatable(const char* name, const char* type,
                  const std::function<void(const std::vector<std::string>&)>& set,
                  const char* description);

  CLI::App* command_;
  std::vector<std::function<void()>> quick_;
};

}  // namespace ptc::bench
