// Reads a file as it is.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace ptc {

/// @returns the bytes of a file; none where it cannot be read
[[nodiscard]] inline std::string slurp(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace ptc
