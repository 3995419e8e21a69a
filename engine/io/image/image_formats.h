// Inside the image readers: what each foreign format needs beside its library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "engine/io/image/image.h"

namespace ptc {

inline constexpr unsigned kMostImageSide = 1U << 16;
inline constexpr std::uint64_t kMostPixels = std::uint64_t{1} << 28;

/// Refuses an EXR whose headers ask for more memory than the file can justify.
/// @throws DataError, std::system_error
void check_exr_headers(const std::filesystem::path& path);
[[nodiscard]] Image read_exr(const std::filesystem::path& path);

enum class RasterFormat { none, png, jpeg, bmp, hdr, tga };

/// By the first bytes; TGA has no mark and is believed when `name` ends in ".tga".
[[nodiscard]] RasterFormat raster_format(std::span<const std::byte> bytes, const std::string& name);

/// Whether all bytes that the format needs are there: stb fills what is missing with zeros.
[[nodiscard]] bool raster_is_complete(std::span<const std::byte> bytes, RasterFormat format);

}  // namespace ptc
