// Reading and writing of whole pictures: EXR through OpenEXR, PNG through libpng, JPEG through
// libjpeg, HDR by this program, BMP and TGA through stb.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
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

/// What an EXR file says of a layer. A colour has the channels "NAME.R", "NAME.G" and "NAME.B", or
/// "R", "G" and "B" when the name is empty. A scalar has the channel "NAME.V"; a vector has the
/// channels "NAME.X", "NAME.Y" and "NAME.Z". A layer of kind `channel` has the channel "NAME", for
/// those that readers know without a layer: "A" is alpha, "Z" is depth.
struct ExrLayerType {
  std::string name;
  enum class Kind { colour, scalar, vector, channel } kind = Kind::colour;
  bool full_float = false;  ///< float channels; else half, where values above 65504 become 65504

  /// Returns the number of channels.
  [[nodiscard]] unsigned components() const noexcept {
    return kind == Kind::scalar || kind == Kind::channel ? 1 : 3;
  }
};

/// One layer of an EXR file with the values of all pixels.
struct ExrLayer : ExrLayerType {
  std::vector<float> values;  ///< height x width x components
};

/// Texts in the header of an EXR file, by the names of their attributes.
using ExrText = std::map<std::string, std::string>;

/// The part of a picture that a file holds.
struct ImageWindow {
  unsigned x = 0, y = 0;                     ///< its upper left pixel in the picture
  unsigned width = 0, height = 0;            ///< pixels
  unsigned full_width = 0, full_height = 0;  ///< of the picture, pixels

  /// Returns the window that is a whole picture.
  [[nodiscard]] static ImageWindow whole(unsigned width, unsigned height) noexcept {
    return {0, 0, width, height, width, height};
  }
  [[nodiscard]] bool operator==(const ImageWindow&) const = default;
};

/// Writes an EXR file of scan lines with ZIP compression, some rows at a time. The file replaces
/// its target as a whole or not at all.
/// Memory: bytes().
class ExrWriter {
 public:
  /// Creates a temporary file for the picture.
  /// @param window  that the file holds: its data window; the picture is its display window
  /// @param text    attributes of the header, whose names have 1 to 31 bytes
  /// @throws std::system_error; std::invalid_argument when a size is not is_image_size(), the
  ///         window leaves the picture, there is no layer or two have the same name
  ExrWriter(const std::filesystem::path& target, const ImageWindow& window,
            std::vector<ExrLayerType> layers, const ExrText& text = {});
  ~ExrWriter();
  ExrWriter(const ExrWriter&) = delete;
  ExrWriter& operator=(const ExrWriter&) = delete;

  /// Writes the next rows, from the top of the picture down.
  /// @param values  rows x width x components of each layer
  /// @throws std::system_error; std::invalid_argument when the values do not match the rows, or
  ///         these are more than are left
  void write(unsigned rows, std::span<const std::span<const float>> values);
  /// Publishes the picture. @pre all rows are written
  /// @throws std::system_error; std::bad_alloc when rows are missing for want of memory
  void publish();

  /// Returns the memory that writing `rows` rows at once takes.
  [[nodiscard]] static std::uint64_t bytes(unsigned width, unsigned rows,
                                           std::span<const ExrLayerType> layers) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes a whole picture by an ExrWriter.
/// @throws as ExrWriter does
void write_exr(const std::filesystem::path& target, unsigned width, unsigned height,
               const std::vector<ExrLayer>& layers);

/// Writes an 8-bit sRGB PNG file of linear values, which are clamped to [0, 1], some rows at a
/// time. The file replaces its target as a whole or not at all.
/// Memory: some 300 KiB, and 15 bytes for each pixel of a row.
class PngWriter {
 public:
  /// Creates a temporary file for the picture.
  /// @throws std::system_error; std::invalid_argument when the size is not is_image_size()
  PngWriter(const std::filesystem::path& target, unsigned width, unsigned height);
  ~PngWriter();
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  /// Writes the next rows, from the top of the picture down.
  /// @param pixels  whole rows
  /// @throws std::system_error; std::invalid_argument for a row in part or more than are left
  void write(std::span<const glm::vec3> pixels);
  /// Publishes the picture. @pre all rows are written   @throws std::system_error
  void publish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes a whole picture by a PngWriter.
/// @throws as PngWriter does
void write_png(const std::filesystem::path& target, const Image& image);

}  // namespace ptc
