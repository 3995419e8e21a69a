#include "engine/io/image/pixel_type.h"

#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include <half.h>

#include "engine/io/image/srgb.h"

namespace ptc {
namespace {

// Returns the linear values of all stored ones of `Steps` + 1 steps.
template <std::size_t Steps>
const float* linear_of() {
  static const std::vector<float> table = [] {
    std::vector<float> values(Steps + 1);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = static_cast<float>(srgb_to_linear(static_cast<double>(i) / double{Steps}));
    return values;
  }();
  return table.data();
}

// Returns the value of one step of a mantissa for each exponent; an exponent of 0 stands for black.
const float* rgbe_steps() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (int i = 1; i < 256; ++i)
      values[static_cast<std::size_t>(i)] = std::ldexp(1.0F, i - (128 + 8));
    return values;
  }();
  return table.data();
}

float sane(float value) {
  return std::isfinite(value) && value > 0 ? value : 0;
}

template <typename T>
T at(const std::byte* bytes, std::size_t index) {
  T value;
  std::memcpy(&value, bytes + index * sizeof(T), sizeof(T));
  return value;
}

}  // namespace

void make_linear(PixelType type, std::span<const std::byte> stored, std::span<glm::vec3> linear) {
  const std::byte* from = stored.data();
  const auto convert = [&](const auto& value_of) {
    for (glm::vec3& pixel : linear) {
      for (int c = 0; c < 3; ++c) pixel[c] = value_of(static_cast<std::size_t>(c));
      from += pixel_bytes(type);
    }
  };
  switch (type) {
    case PixelType::srgb8:
      return convert([&, table = linear_of<255>()](std::size_t c) {
        return table[at<std::uint8_t>(from, c)];
      });
    case PixelType::srgb16:
      return convert([&, table = linear_of<65535>()](std::size_t c) {
        return table[at<std::uint16_t>(from, c)];
      });
    case PixelType::rgbe:
      return convert([&, steps = rgbe_steps()](std::size_t c) {
        return static_cast<float>(at<std::uint8_t>(from, c)) * steps[at<std::uint8_t>(from, 3)];
      });
    case PixelType::half:
      return convert([&](std::size_t c) {
        half value;
        value.setBits(at<std::uint16_t>(from, c));
        return sane(value);
      });
    case PixelType::share8:
      return convert(
          [&](std::size_t) { return static_cast<float>(at<std::uint8_t>(from, 0)) / 255; });
    case PixelType::full:
      return convert([&](std::size_t c) { return sane(at<float>(from, c)); });
  }
}

}  // namespace ptc
