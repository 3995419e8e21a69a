// How the pixels of a picture are stored, and the linear values for which they stand.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <glm/vec3.hpp>

namespace ptc {

/// How a pixel is stored, in the machine's byte order.
enum class PixelType : std::uint8_t {
  srgb8,   ///< R, G, B of 8 bits on the sRGB curve
  srgb16,  ///< R, G, B of 16 bits on the sRGB curve
  rgbe,    ///< mantissas of R, G and B and their exponent: Ward, "Real Pixels", 1991
  half,    ///< R, G, B, linear, of 16 bits
  full,    ///< R, G, B, linear, of 32 bits
  share8   ///< a single linear value of 8 bits for R, G and B; 255 stands for 1
};

/// Returns the size of a pixel, bytes.
[[nodiscard]] constexpr std::size_t pixel_bytes(PixelType type) noexcept {
  switch (type) {
    case PixelType::share8:
      return 1;
    case PixelType::srgb8:
      return 3;
    case PixelType::rgbe:
      return 4;
    case PixelType::srgb16:
    case PixelType::half:
      return 6;
    case PixelType::full:
      break;
  }
  return 12;
}

/// Converts stored pixels to linear values. Negative and non-finite values become 0.
/// @param stored  pixel_bytes(type) for each value
void make_linear(PixelType type, std::span<const std::byte> stored, std::span<glm::vec3> linear);

}  // namespace ptc
