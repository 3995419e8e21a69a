// Files for the tests of readers and writers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/slurp.h"
#include "tests/support/temporary_directory.h"

namespace ptc {

/// Returns the bytes of a value as they lie in memory, for binary files.
template <typename T>
std::string raw(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

/// Returns a TGA of one row of white pixels with these alphas.
[[nodiscard]] std::string tga_with_alpha(const std::vector<std::uint8_t>& alpha);

/// Returns the message of the DataError, FormatError or std::system_error that `call` throws; empty
/// when it throws nothing. Any other exception passes.
[[nodiscard]] std::string refusal(const std::function<void()>& call);

/// Returns a folder of real files that is not part of the project, if this machine has it:
/// PTC_SHARED or, without that variable, "../shared" next to the sources.
[[nodiscard]] std::optional<std::filesystem::path> shared_data();

}  // namespace ptc
