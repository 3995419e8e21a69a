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

namespace ptc {

/// A directory that is removed together with its contents.
class Scratch {
 public:
  Scratch();
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Writes a file of these bytes and returns its path.
  std::filesystem::path file(const std::string& name, std::string_view bytes) const;
  /// Returns the names of all entries, sorted and separated by blanks.
  [[nodiscard]] std::string listing() const;

 private:
  std::filesystem::path path_;
};

[[nodiscard]] std::string slurp(const std::filesystem::path& path);

/// Returns the bytes of a value as they lie in memory, for binary files.
template <typename T>
std::string raw(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

/// Returns the message of the DataError, FormatError or std::system_error that `call` throws; empty
/// when it throws nothing. Any other exception passes.
[[nodiscard]] std::string refusal(const std::function<void()>& call);

/// Returns a folder of real files that is not part of the project, if this machine has it:
/// PTC_SHARED or, without that variable, "../shared" next to the sources.
[[nodiscard]] std::optional<std::filesystem::path> shared_data();

}  // namespace ptc
