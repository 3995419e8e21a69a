// The text of --help.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace ptc {

/// Prints a program's summary, usage, commands, options by group and examples, in lines of at most
/// 100 columns. Each option takes one line unless its text is too long.
class HelpFormatter final : public CLI::FormatterBase {
 public:
  /// @param name  of the program, or "PROGRAM COMMAND"
  [[nodiscard]] std::string make_help(const CLI::App* app, std::string name,
                                      CLI::AppFormatMode mode) const override;
};

/// Lines on the suffixes of the values that these options take; empty when none takes any.
[[nodiscard]] std::string suffixes_text(const CLI::App& app);

/// The lines of a footer that belong to a command: each command line that begins with `name`, and
/// the comment before it.
[[nodiscard]] std::string examples_of(const std::string& footer, const std::string& name);

}  // namespace ptc
