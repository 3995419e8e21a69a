// Completions for shells: options, their words, files with fitting endings, directories.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace ptc {

/// The completion of a program for bash, a script that defines one function and registers it.
[[nodiscard]] std::string bash_completion(const CLI::App& app);

/// The completion of a program for zsh, a file "_PROGRAM" for a directory of $fpath.
[[nodiscard]] std::string zsh_completion(const CLI::App& app);

/// The completion of a program for fish, a file "PROGRAM.fish".
[[nodiscard]] std::string fish_completion(const CLI::App& app);

}  // namespace ptc
