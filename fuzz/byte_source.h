// Numbers out of the bytes of a fuzzer; zeros when they are used up.
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

class ByteSource {
 public:
  ByteSource(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  [[nodiscard]] bool empty() const noexcept { return rest_.empty(); }
  template <class T = std::uint8_t>
  T take() {
    T value{};
    const std::size_t bytes = std::min(sizeof value, rest_.size());
    if (bytes > 0) std::memcpy(&value, rest_.data(), bytes);
    rest_ = rest_.subspan(bytes);
    return value;
  }
  /// 0 to n - 1.
  std::uint32_t below(std::uint32_t n) { return take<std::uint32_t>() % n; }
  /// Finite and, with `least` 0, not negative.
  template <class T>
  T number(T least = std::numeric_limits<T>::lowest()) {
    const T value = take<T>();
    if (!std::isfinite(value)) return T{1};
    return value < least ? -value : value;
  }
  std::string text(std::size_t most, const char* letters, std::size_t count) {
    std::string out(1 + take() % most, '\0');
    for (char& c : out) c = letters[take() % count];
    return out;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace ptc::fuzz
