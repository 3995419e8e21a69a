// Files of text that memory holds.
#pragma once

#include <filesystem>
#include <string>

#include "engine/io/file/file.h"

namespace ptc {

/// Reads a file. @throws std::system_error
[[nodiscard]] std::string read_text(const InputFile& file);
[[nodiscard]] std::string read_text(const std::filesystem::path& path);

/// Writes a file, which appears or is replaced whole (OutputFile). @throws std::system_error
void write_text(const std::filesystem::path& path, const std::string& text);

/// Returns what a log holds; empty when there is none, or when it cannot be read.
[[nodiscard]] std::string text_of_log(const std::filesystem::path& path);

}  // namespace ptc
