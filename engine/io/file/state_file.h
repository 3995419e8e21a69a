// The state that a program keeps for its next run: checked bytes in a file that is replaced as a
// whole.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "format/bytes.h"

namespace ptc {

/// Bytes of a file of state before the state.
inline constexpr std::uint64_t kStateOffset = 32;

/// Encodes numbers, bytes and texts one after another. A StateReader reads them in the same order.
class StateWriter {
 public:
  /// Appends a number or an array of three doubles.
  template <class T>
  void put(T value) {
    bytes_.resize(bytes_.size() + sizeof value);
    store(bytes_.data(), bytes_.size() - sizeof value, value);
  }
  /// Makes room for this many more bytes, so that those that were appended are not copied.
  void reserve(std::size_t bytes) { bytes_.reserve(bytes_.size() + bytes); }
  /// Appends bytes, preceded by their number.
  void put_bytes(std::span<const std::byte> bytes);
  /// Appends a text as put_bytes() does.
  void put_text(std::string_view text) { put_bytes(std::as_bytes(std::span(text))); }
  /// Returns everything that was appended; the writer is empty afterwards.
  [[nodiscard]] std::vector<std::byte> take() noexcept { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

/// Decodes what a StateWriter wrote, in the same order. It never reads beyond the end, whatever the
/// bytes say. Every get function and end() throw DataError that names the file when the bytes do
/// not match the call.
class StateReader {
 public:
  /// @param bytes  the encoded state, which must outlive this reader
  /// @param name   name of the file, for errors
  /// @param begins  offset of the state in its file; errors then name the offset of the number that
  ///                was read last
  StateReader(std::span<const std::byte> bytes, std::string name,
              std::optional<std::uint64_t> begins = std::nullopt)
      : bytes_(bytes), all_(bytes.size()), begins_(begins), name_(std::move(name)) {}

  /// Returns the next number or array of three doubles.
  template <class T>
  [[nodiscard]] T get() {
    return load<T>(take(sizeof(T)).data(), 0);
  }
  /// Returns the next number, a u64 that must be at most `most`.
  [[nodiscard]] std::uint64_t get_count(std::uint64_t most);
  /// Returns the next bytes of put_bytes(), a view into the state.
  [[nodiscard]] std::span<const std::byte> get_bytes();
  /// Returns the next text of put_text().
  [[nodiscard]] std::string get_text();
  /// Checks that no bytes are left.
  void end() const;
  /// Checks a rule of the caller. @param text  what is wrong when it does not hold
  void require(bool holds, const std::string& text) const {
    if (!holds) fail(text);
  }

 private:
  [[noreturn]] void fail(const std::string& text) const;
  [[nodiscard]] std::span<const std::byte> take(std::uint64_t count);

  std::span<const std::byte> bytes_;  ///< not read yet
  std::size_t all_, last_ = 0;        ///< number of bytes, and the place of the last number
  std::optional<std::uint64_t> begins_;
  std::string name_;
};

/// Returns the name under which write_state() writes. A file of this name that a killed process has
/// left is overwritten.
[[nodiscard]] std::filesystem::path state_temporary(const std::filesystem::path& path);
/// Writes a state under a temporary name, flushes it to stable storage and renames it over the old
/// one. At any moment either the old or the new state exists, complete. @throws std::system_error
void write_state(const std::filesystem::path& path, std::span<const std::byte> state);
/// Writes a state as write_state() does, under a temporary name of this process alone: others may
/// write a state of the same name at the same time, and the last one stays.
void write_shared_state(const std::filesystem::path& path, std::span<const std::byte> state);
/// Reads a state and checks it.
/// @throws DataError that names the file when it is not what write_state() wrote; std::system_error
[[nodiscard]] std::vector<std::byte> read_state(const std::filesystem::path& path);

/// A file that only one process at a time can lock. The lock lasts as long as this object.
class FileLock {
 public:
  /// Locks the file, which is created if it does not exist. It does not wait.
  /// @throws std::system_error (EWOULDBLOCK) when another process holds the lock; std::system_error
  ///         when the file cannot be opened or locked
  explicit FileLock(const std::filesystem::path& path);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  int fd_ = -1;
};

}  // namespace ptc
