// What help texts, man pages and shells say of a program, read from its declared options.
//
//   CLI::App --> groups_of() --+--> help.h        --help
//                              +--> man_page.h    --generate man
//                              +--> completion.h  --generate bash|zsh|fish
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace ptc {

/// One option or positional argument as its readers see it.
struct OptionText {
  std::vector<std::string> names;  ///< "-o" and "--output"; empty for a positional argument
  std::string value;               ///< the word for its value, "FILE"; empty for a flag
  std::string summary;             ///< a phrase of one line, without a full stop
  std::string details;             ///< whole sentences for the man page alone; may be empty
  std::string default_value;  ///< empty: none; from the option, or "[default: ...]" in its text
  std::vector<std::string> choices;   ///< words that a shell proposes as the value
  std::vector<std::string> endings;   ///< endings of the files that fit, ".ply"; empty: all files
  std::vector<std::string> needs;     ///< options that must be given with this one, in order
  std::vector<std::string> excludes;  ///< options that must not be given with this one, in order
  bool required = false;
  bool repeatable = false;  ///< takes any number of values

  [[nodiscard]] bool positional() const noexcept { return names.empty(); }
  /// True when the value names a file, or may name one.
  [[nodiscard]] bool takes_file() const noexcept;
  /// True when the value names a directory.
  [[nodiscard]] bool takes_directory() const noexcept { return value == "DIR"; }
};

/// Options under one heading.
struct OptionGroup {
  std::string title;
  std::vector<OptionText> options;
};

/// The heading of options that most users never need, which comes last.
inline constexpr char kExpertGroup[] = "Expert";
/// The heading of positional arguments and of the files that a program reads and writes.
inline constexpr char kFilesGroup[] = "Input and output";

/// Makes shells propose these values: words, or endings of file names, which begin with a point. A
/// word that ends with "=" is continued by the name of a file with one of the endings.
/// @return the option
CLI::Option* offer(CLI::Option* option, const std::vector<std::string>& values);

/// The options of a program or of one of its commands, in the order of the help: positional
/// arguments first, headings in the order of declaration, kExpertGroup last. A command is followed
/// by what its program declares. Hidden options are left out.
[[nodiscard]] std::vector<OptionGroup> groups_of(const CLI::App& app);

/// The commands of a program, in the order of declaration; empty for most programs.
[[nodiscard]] std::vector<const CLI::App*> commands_of(const CLI::App& app);

/// The arguments in a usage line: "[OPTION]... -o FILE [INPUT]...".
[[nodiscard]] std::string usage_of(const CLI::App& app);

/// Parts of a text between separators; an empty text has none.
[[nodiscard]] std::vector<std::string> split(const std::string& text, char separator);

/// A text with its ASCII letters as capitals.
[[nodiscard]] std::string upper_case(std::string text);

/// Parts with a separator between each two.
[[nodiscard]] std::string join(const std::vector<std::string>& parts, const std::string& separator);

}  // namespace ptc
