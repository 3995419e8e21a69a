// Numbers and texts that a fuzz target takes from the bytes of the fuzzer.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>

namespace ptc::fuzz {

/// Hands out the bytes of a fuzzer from front to back, and zeros once they are used up.
class ByteSource {
 public:
  /// @param data  bytes that outlive this source
  ByteSource(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  /// Says whether all bytes are used up.
  [[nodiscard]] bool empty() const noexcept { return rest_.empty(); }
  /// Returns the next sizeof(T) bytes as a T; bytes that are missing are zero.
  template <class T = std::uint8_t>
  T take() {
    T value{};
    const std::size_t bytes = std::min(sizeof value, rest_.size());
    if (bytes > 0) std::memcpy(&value, rest_.data(), bytes);
    rest_ = rest_.subspan(bytes);
    return value;
  }
  /// Returns a number from 0 to n - 1.
  std::uint32_t below(std::uint32_t n) { return take<std::uint32_t>() % n; }
  /// Returns a finite number, which is not negative when `least` is 0.
  template <class T>
  T number(T least = std::numeric_limits<T>::lowest()) {
    const T value = take<T>();
    if (!std::isfinite(value)) return T{1};
    return value < least ? -value : value;
  }
  /// Returns a text of 1 to `most` letters from the first `count` of `letters`.
  std::string text(std::size_t most, const char* letters, std::size_t count) {
    std::string out(1 + take() % most, '\0');
    for (char& c : out) c = letters[take() % count];
    return out;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace ptc::fuzz
