// Internal to the image readers: the checks of foreign formats that their libraries lack.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "engine/io/image/image.h"

namespace ptc {

/// Checks the headers of an EXR file. It refuses a file whose headers ask for more memory than its
/// length can justify, or for more pixels than `max_pixels`.
/// @throws DataError, std::system_error
void check_exr_headers(const std::filesystem::path& path, std::uint64_t max_pixels);
/// Reads an EXR file as read_image() describes.
/// @throws DataError, std::system_error
[[nodiscard]] Image read_exr(const std::filesystem::path& path, std::uint64_t max_pixels);

/// The formats that stb decodes; `none` stands for any other.
enum class RasterFormat { none, png, jpeg, bmp, hdr, tga };

/// Returns the format that the first bytes of a file have. TGA has no magic number, so a name that
/// ends in ".tga" decides.
[[nodiscard]] RasterFormat raster_format(std::span<const std::byte> bytes, const std::string& name);

/// Checks that a file holds its whole picture, because stb would fill the rest with zeros. It also
/// refuses a JPEG with more scans than encoders write, because stb decodes each scan over the whole
/// picture.
/// @param pixels  number of pixels of the picture, at most kMaxImagePixels
/// @param name    name of the picture for errors
/// @throws DataError that names the offset
void check_raster(std::span<const std::byte> bytes, RasterFormat format, std::uint64_t pixels,
                  const std::string& name);

}  // namespace ptc
