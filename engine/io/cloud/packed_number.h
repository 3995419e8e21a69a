// Internal to the point readers: numbers in packed records, which are little-endian and not
// aligned.
#pragma once

#include <cstddef>
#include <cstring>
#include <string_view>

#include "format/bytes.h"
#include "format/scalar.h"
#include "format/schema.h"

namespace ptc {

/// Returns the number of a type at `from`. It is exact unless it is an integer beyond 2^53.
[[nodiscard]] inline double load_number(const std::byte* from, ChannelType type) noexcept {
  switch (type) {
    case ChannelType::u8:
      return load<std::uint8_t>(from, 0);
    case ChannelType::i8:
      return load<std::int8_t>(from, 0);
    case ChannelType::u16:
      return load<std::uint16_t>(from, 0);
    case ChannelType::i16:
      return load<std::int16_t>(from, 0);
    case ChannelType::u32:
      return load<std::uint32_t>(from, 0);
    case ChannelType::i32:
      return load<std::int32_t>(from, 0);
    case ChannelType::u64:
      return static_cast<double>(load<std::uint64_t>(from, 0));
    case ChannelType::i64:
      return static_cast<double>(load<std::int64_t>(from, 0));
    case ChannelType::half:
      return static_cast<double>(decode_half(load<std::uint16_t>(from, 0)));
    case ChannelType::f32:
      return static_cast<double>(load<float>(from, 0));
    case ChannelType::f64:
      break;
  }
  return load<double>(from, 0);
}

/// Stores a value as a number of a type, which is not half. A value beyond the range of float is
/// stored as infinity. @return false when the type is an integer that cannot hold the value
[[nodiscard]] bool store_number(double value, ChannelType type, std::byte* to) noexcept;

/// Stores the number that a word stands for. Integers of 64 bits are exact.
/// @return false when the word is not a number or does not fit the type
[[nodiscard]] bool store_word(std::string_view word, ChannelType type, std::byte* to) noexcept;

}  // namespace ptc
