// Man pages.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace ptc {

/// What a man page says besides the options.
struct ManText {
  std::string description;  ///< paragraphs with empty lines between them
  std::string exit_codes;   ///< a line each: "CODE NAME: meaning"
};

/// The page of a program in section 1, in the macros of man(7). It depends on the sources alone:
/// it bears the version of the project and the date of its texts.
[[nodiscard]] std::string man_page(const CLI::App& app, const ManText& text);

}  // namespace ptc
