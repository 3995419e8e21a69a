// Pictures in and out: EXR, and 8-bit formats through stb.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

namespace ptc {

/// The largest pictures that are read and written, in pixels.
inline constexpr unsigned kMaxImageSide = 1U << 16;
inline constexpr std::uint64_t kMaxImagePixels = std::uint64_t{1} << 28;

/// Linear RGB, row by row from the top.
struct Image {
  unsigned width = 0;
  unsigned height = 0;
  std::vector<glm::vec3> pixels;  ///< height x width

  [[nodiscard]] const glm::vec3& at(unsigned x, unsigned y) const {
    return pixels[std::size_t{y} * width + x];
  }
};

/// EXR (any compression), PNG, JPEG, TGA, BMP, HDR; told apart by content, TGA by its name. Files
/// of 8 and 16 bits are taken as sRGB and made linear; alpha is left out. Negative and non-finite
/// values become 0. At most 2^28 pixels, 2^16 a side.
///
/// An EXR gives the data window of its first part: channels R G B, or Y as grey; deep parts are
/// refused.
/// @param max_pixels  at most kMaxImagePixels
/// @throws DataError when it is no such picture, ends too early or has more pixels;
///         std::system_error
/// Memory: 12 bytes a pixel, and what the decoder takes.
[[nodiscard]] Image read_image(const std::filesystem::path& path,
                               std::uint64_t max_pixels = kMaxImagePixels);

/// The same for a PNG, JPEG, TGA, BMP or HDR in memory.
/// @param name  what errors call it; a name that ends in ".tga" says that it is a TGA
[[nodiscard]] Image decode_image(std::span<const std::byte> bytes, const std::string& name,
                                 std::uint64_t max_pixels = kMaxImagePixels);

/// One layer of an EXR file: channel names are "R" "G" "B" for the empty name, else "NAME.R" ... ;
/// one-component layers have the channel "NAME.V"; three-component vectors "NAME.X" "NAME.Y"
/// "NAME.Z".
struct ExrLayer {
  std::string name;
  enum class Kind { colour, scalar, vector } kind = Kind::colour;
  bool full_float = false;    ///< float channels, else half, where larger values become 65504
  std::vector<float> values;  ///< height x width x components
};

/// Scan lines, ZIP-compressed. Published whole or not at all.
/// @throws std::system_error; std::invalid_argument when a layer has another number of values, two
///         layers have one name, a side is 0 or above 2^16, or there are more than 2^28 pixels
void write_exr(const std::filesystem::path& target, unsigned width, unsigned height,
               const std::vector<ExrLayer>& layers);

/// 8-bit sRGB PNG of linear values, clamped to [0, 1]. Published whole or not at all.
/// @throws std::system_error, std::invalid_argument as write_exr()
void write_png(const std::filesystem::path& target, const Image& image);

}  // namespace ptc
