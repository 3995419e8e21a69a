// Inside the image readers: what each foreign format needs beside its library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "engine/io/image/image.h"

namespace ptc {

/// Refuses an EXR whose headers ask for more memory than the file can justify, or for more pixels
/// than `max_pixels`.
/// @throws DataError, std::system_error
void check_exr_headers(const std::filesystem::path& path, std::uint64_t max_pixels);
[[nodiscard]] Image read_exr(const std::filesystem::path& path, std::uint64_t max_pixels);

enum class RasterFormat { none, png, jpeg, bmp, hdr, tga };

/// By the first bytes; TGA has no mark and is believed when `name` ends in ".tga".
[[nodiscard]] RasterFormat raster_format(std::span<const std::byte> bytes, const std::string& name);

/// Refuses bytes that end before the picture does, which stb would fill with zeros, and a JPEG of
/// more scans than encoders write, each of which stb decodes over the whole picture.
/// @param pixels  of the picture, at most kMaxImagePixels
/// @throws DataError
void check_raster(std::span<const std::byte> bytes, RasterFormat format, std::uint64_t pixels,
                  const std::string& name);

}  // namespace ptc
