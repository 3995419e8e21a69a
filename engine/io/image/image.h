// Reading and writing of pictures: EXR through OpenEXR, other formats through stb.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

namespace ptc {

/// The greatest width and height of a picture that is read or written, pixels.
inline constexpr unsigned kMaxImageSide = 1U << 16;
/// The greatest number of pixels of a picture that is read or written.
inline constexpr std::uint64_t kMaxImagePixels = std::uint64_t{1} << 28;

/// Says whether a picture of this size is read and written: one with pixels, within both limits.
[[nodiscard]] constexpr bool is_image_size(std::uint64_t width, std::uint64_t height) noexcept {
  return width > 0 && height > 0 && width <= kMaxImageSide && height <= kMaxImageSide &&
         width * height <= kMaxImagePixels;
}

/// A picture of linear RGB values, row by row from the top.
struct Image {
  unsigned width = 0;             ///< pixels
  unsigned height = 0;            ///< pixels
  std::vector<glm::vec3> pixels;  ///< height x width

  /// Returns the pixel in column x of row y.
  [[nodiscard]] const glm::vec3& at(unsigned x, unsigned y) const {
    return pixels[std::size_t{y} * width + x];
  }
};

/// Reads an EXR (any compression), PNG, JPEG, TGA, BMP or HDR file. The content decides the format,
/// except that TGA is known by its name. Values of 8 and 16 bits are taken as sRGB and made linear;
/// alpha is ignored. Negative and non-finite values become 0.
///
/// An EXR file gives the data window of its first part: channels R G B, or Y as grey. Deep parts
/// are refused.
/// @param max_pixels  greatest number of pixels to accept, at most kMaxImagePixels
/// @throws DataError when the file is not such a picture, ends too early, has more than
///         `max_pixels` pixels or a side above kMaxImageSide; std::system_error
/// Memory: 12 bytes per pixel, plus the memory of the decoder.
[[nodiscard]] Image read_image(const std::filesystem::path& path,
                               std::uint64_t max_pixels = kMaxImagePixels);

/// Decodes a PNG, JPEG, TGA, BMP or HDR file in memory as read_image() does.
/// @param name  name of the picture for errors; a name that ends in ".tga" means a TGA
/// @throws DataError as read_image() does
[[nodiscard]] Image decode_image(std::span<const std::byte> bytes, const std::string& name,
                                 std::uint64_t max_pixels = kMaxImagePixels);

/// One layer of an EXR file. A colour has the channels "NAME.R", "NAME.G" and "NAME.B", or "R", "G"
/// and "B" when the name is empty. A scalar has the channel "NAME.V"; a vector has the channels
/// "NAME.X", "NAME.Y" and "NAME.Z".
struct ExrLayer {
  std::string name;
  enum class Kind { colour, scalar, vector } kind = Kind::colour;
  bool full_float = false;    ///< float channels; else half, where values above 65504 become 65504
  std::vector<float> values;  ///< height x width x components, components being 3 or 1
};

/// Writes an EXR file of scan lines with ZIP compression. The file replaces `target` as a whole or
/// not at all.
/// @throws std::system_error; std::invalid_argument when the number of a layer's values does not
///         match the size, two layers have the same name, a side is 0 or above 2^16, or there are
///         more than 2^28 pixels
void write_exr(const std::filesystem::path& target, unsigned width, unsigned height,
               const std::vector<ExrLayer>& layers);

/// Writes an 8-bit sRGB PNG file of linear values, which are clamped to [0, 1]. The file replaces
/// `target` as a whole or not at all.
/// @throws std::system_error; std::invalid_argument as write_exr() does
void write_png(const std::filesystem::path& target, const Image& image);

}  // namespace ptc
