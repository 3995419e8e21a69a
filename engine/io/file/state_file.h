// What a program keeps for its next run: checked bytes in a file that is replaced whole.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "format/bytes.h"

namespace ptc {

/// Appends numbers and texts for a StateReader.
class StateWriter {
 public:
  template <class T>
  void put(T value) {
    bytes_.resize(bytes_.size() + sizeof value);
    store(bytes_.data(), bytes_.size() - sizeof value, value);
  }
  void put_bytes(std::span<const std::byte> bytes);
  void put_text(std::string_view text) { put_bytes(std::as_bytes(std::span(text))); }
  [[nodiscard]] std::vector<std::byte> take() noexcept { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

/// Reads what a StateWriter wrote, in the same order. Nothing is read beyond the end, whatever the
/// bytes say.
class StateReader {
 public:
  /// @param bytes  must outlive this
  /// @param name   of the file, for errors
  StateReader(std::span<const std::byte> bytes, std::string name)
      : bytes_(bytes), name_(std::move(name)) {}

  /// @throws DataError as all of these
  template <class T>
  [[nodiscard]] T get() {
    return load<T>(take(sizeof(T)).data(), 0);
  }
  /// A number that is at most `most`.
  [[nodiscard]] std::uint64_t get_count(std::uint64_t most);
  [[nodiscard]] std::span<const std::byte> get_bytes();
  [[nodiscard]] std::string get_text();
  /// Refuses bytes that are left.
  void end() const;
  void require(bool holds, const char* text) const {
    if (!holds) fail(text);
  }

 private:
  [[noreturn]] void fail(const std::string& text) const;
  [[nodiscard]] std::span<const std::byte> take(std::uint64_t count);

  std::span<const std::byte> bytes_;
  std::string name_;
};

/// Under which write_state() writes: one that a process which was killed has left is overwritten by
/// the next.
[[nodiscard]] std::filesystem::path state_temporary(const std::filesystem::path& path);
/// Writes a state under a temporary name, syncs it and renames it over the old one: at any moment
/// the one or the other is there, whole.
void write_state(const std::filesystem::path& path, std::span<const std::byte> state);
/// @throws DataError naming the file when it is not what write_state() wrote; std::system_error
[[nodiscard]] std::vector<std::byte> read_state(const std::filesystem::path& path);

/// A file that one process at a time holds, as long as this lives; made when it is not there.
class FileLock {
 public:
  /// @throws std::system_error, also when another process holds it
  explicit FileLock(const std::filesystem::path& path);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int fd_ = -1;
};

}  // namespace ptc
