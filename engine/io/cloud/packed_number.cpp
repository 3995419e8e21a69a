// Conversion of values and words to the numbers of packed records.
#include "engine/io/cloud/packed_number.h"

#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "engine/io/text/text.h"

namespace ptc {
namespace {

template <typename T>
void put(T value, std::byte* to) noexcept {
  std::memcpy(to, &value, sizeof value);
}

template <typename T>
bool store_integer(double value, std::byte* to) noexcept {
  // The end of the range is a power of two, so it is exact in double, unlike the maximum of 64
  // bits.
  constexpr auto kLow = static_cast<double>(std::numeric_limits<T>::lowest());
  const double end = std::ldexp(1.0, std::numeric_limits<T>::digits);
  if (!(value >= kLow && value < end && value == std::trunc(value))) return false;
  put(static_cast<T>(value), to);
  return true;
}

float to_float(double value) noexcept {
  constexpr double kMost = std::numeric_limits<float>::max();
  if (std::abs(value) > kMost) {
    return std::copysign(std::numeric_limits<float>::infinity(), value < 0 ? -1.0F : 1.0F);
  }
  return static_cast<float>(value);
}

}  // namespace

bool store_number(double value, ChannelType type, std::byte* to) noexcept {
  switch (type) {
    case ChannelType::u8:
      return store_integer<std::uint8_t>(value, to);
    case ChannelType::i8:
      return store_integer<std::int8_t>(value, to);
    case ChannelType::u16:
    case ChannelType::half:
      return store_integer<std::uint16_t>(value, to);
    case ChannelType::i16:
      return store_integer<std::int16_t>(value, to);
    case ChannelType::u32:
      return store_integer<std::uint32_t>(value, to);
    case ChannelType::i32:
      return store_integer<std::int32_t>(value, to);
    case ChannelType::u64:
      return store_integer<std::uint64_t>(value, to);
    case ChannelType::i64:
      return store_integer<std::int64_t>(value, to);
    case ChannelType::f32:
      put(to_float(value), to);
      return true;
    case ChannelType::f64:
      break;
  }
  put(value, to);
  return true;
}

bool store_word(std::string_view word, ChannelType type, std::byte* to) noexcept {
  if (type == ChannelType::u64) {
    std::uint64_t value = 0;
    const char* const end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, value);
    if (stop == end && error == std::errc()) {
      put(value, to);
      return true;
    }
  } else if (type == ChannelType::i64) {
    if (const std::optional<std::int64_t> value = parse_integer(word)) {
      put(*value, to);
      return true;
    }
  }
  const std::optional<double> value = parse_number(word);
  return value && store_number(*value, type, to);
}

}  // namespace ptc
