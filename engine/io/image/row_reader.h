// Internal to the image readers: pictures that are decoded row by row.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include "engine/io/image/byte_range.h"
#include "engine/io/image/image.h"
#include "engine/io/image/pixel_type.h"

namespace ptc {

/// What a picture may ask for.
struct PictureLimits {
  std::uint64_t max_pixels = kMaxImagePixels;
  /// Memory for pictures that cannot be decoded row by row, bytes.
  std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max();
};

/// Which values of its pixels a picture is opened for.
enum class Channels : std::uint8_t {
  colour,
  alpha  ///< as PixelType::share8; 1 where the picture has none
};

/// Decodes a picture from the top down, some rows at a time.
class RowReader {
 public:
  virtual ~RowReader() = default;
  RowReader(const RowReader&) = delete;
  RowReader& operator=(const RowReader&) = delete;

  [[nodiscard]] unsigned width() const noexcept { return width_; }
  [[nodiscard]] unsigned height() const noexcept { return height_; }
  [[nodiscard]] PixelType type() const noexcept { return type_; }

  /// Decodes the next rows. Behind the last row, the rest of the file is checked.
  /// @param out  rows x width() pixels of type()
  /// @pre   so many rows are left
  /// @throws DataError, std::system_error
  virtual void read(unsigned rows, std::span<std::byte> out) = 0;

 protected:
  RowReader() = default;

  unsigned width_ = 0, height_ = 0;  ///< pixels; set by the constructors of the formats
  PixelType type_ = PixelType::srgb8;
};

/// Opens a picture; its first bytes decide its format, except that a TGA is known by its name.
/// @param bytes  what they are in must outlive the reader
/// @param name   name of the picture for errors
/// @return null for the alpha of a picture in a format that has none here: JPEG, HDR and EXR
/// @throws DataError when the bytes are no picture that can be read, or break a limit on pixels;
///         LimitError when decoding takes more memory than it may; std::system_error
[[nodiscard]] std::unique_ptr<RowReader> open_picture(const ByteRange& bytes,
                                                      const std::string& name,
                                                      const PictureLimits& limits,
                                                      Channels channels = Channels::colour);

// The readers of each format, which open_picture() chooses from.

[[nodiscard]] std::unique_ptr<RowReader> open_exr(const std::filesystem::path& path,
                                                  const PictureLimits& limits);
[[nodiscard]] std::unique_ptr<RowReader> open_hdr(const ByteRange& bytes, const std::string& name,
                                                  const PictureLimits& limits);
[[nodiscard]] std::unique_ptr<RowReader> open_jpeg(const ByteRange& bytes, const std::string& name,
                                                   const PictureLimits& limits);
[[nodiscard]] std::unique_ptr<RowReader> open_png(const ByteRange& bytes, const std::string& name,
                                                  const PictureLimits& limits, Channels channels);
/// Decodes a BMP or TGA as a whole through stb.
[[nodiscard]] std::unique_ptr<RowReader> open_by_stb(const ByteRange& bytes,
                                                     const std::string& name, bool is_tga,
                                                     const PictureLimits& limits,
                                                     Channels channels);

/// Takes the alpha out of pixels of R, G, B and alpha, of 8 bits each.
inline void take_alpha(std::span<const std::byte> pixels, std::span<std::byte> alpha) {
  for (std::size_t i = 0; i < alpha.size(); ++i) alpha[i] = pixels[4 * i + 3];
}

/// Checks the size of a picture before anything is allocated for it. Deflate, the end-of-band runs
/// of JPEG and run lengths make fewer than 8448 pixels of a byte (in a 1-bit PNG), so a small file
/// cannot ask for much.
/// @throws DataError
void check_picture_size(std::uint64_t width, std::uint64_t height, std::uint64_t file_bytes,
                        const PictureLimits& limits, const std::string& name);

/// Checks the memory of a picture that cannot be decoded row by row.
/// @param why  "an interlaced PNG"
/// @throws LimitError
void check_picture_memory(std::uint64_t bytes, const char* why, const PictureLimits& limits,
                          const std::string& name);

/// Hands out the rows of a picture that is decoded as a whole.
class WholeRows {
 public:
  WholeRows() = default;
  explicit WholeRows(std::vector<std::byte> pixels) : pixels_(std::move(pixels)) {}
  void take(std::span<std::byte> out) {
    std::ranges::copy(std::span(pixels_).subspan(next_, out.size()), out.begin());
    next_ += out.size();
  }

 private:
  std::vector<std::byte> pixels_;
  std::size_t next_ = 0;
};

}  // namespace ptc
