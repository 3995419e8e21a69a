// Internal to the point readers: numbers in packed records, which are little-endian and not
// aligned.
#pragma once

#include <cstddef>
#include <cstring>
#include <string_view>

#include "format/scalar.h"
#include "format/schema.h"

namespace ptc {

/// Returns the value of type T whose bytes begin at `from`.
template <typename T>
[[nodiscard]] T load_as(const std::byte* from) noexcept {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

/// Returns the number of a type at `from`. It is exact unless it is an integer beyond 2^53.
[[nodiscard]] inline double load_number(const std::byte* from, ChannelType type) noexcept {
  switch (type) {
    case ChannelType::u8:
      return load_as<std::uint8_t>(from);
    case ChannelType::i8:
      return load_as<std::int8_t>(from);
    case ChannelType::u16:
      return load_as<std::uint16_t>(from);
    case ChannelType::i16:
      return load_as<std::int16_t>(from);
    case ChannelType::u32:
      return load_as<std::uint32_t>(from);
    case ChannelType::i32:
      return load_as<std::int32_t>(from);
    case ChannelType::u64:
      return static_cast<double>(load_as<std::uint64_t>(from));
    case ChannelType::i64:
      return static_cast<double>(load_as<std::int64_t>(from));
    case ChannelType::half:
      return static_cast<double>(decode_half(load_as<std::uint16_t>(from)));
    case ChannelType::f32:
      return static_cast<double>(load_as<float>(from));
    case ChannelType::f64:
      break;
  }
  return load_as<double>(from);
}

/// Stores a value as a number of a type, which is not half. A value beyond the range of float is
/// stored as infinity. @return false when the type is an integer that cannot hold the value
[[nodiscard]] bool store_number(double value, ChannelType type, std::byte* to) noexcept;

/// Stores the number that a word stands for. Integers of 64 bits are exact.
/// @return false when the word is not a number or does not fit the type
[[nodiscard]] bool store_word(std::string_view word, ChannelType type, std::byte* to) noexcept;

}  // namespace ptc
