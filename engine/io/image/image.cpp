// Pictures of every format, through the reader that their first bytes ask for.
#include "engine/io/image/image.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/image/row_reader.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr unsigned kRows = 32;  // that are decoded at once

bool begins_with(std::span<const std::byte> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() &&
         std::ranges::equal(bytes.first(magic.size()), magic, [](std::byte a, char b) {
           return std::to_integer<unsigned char>(a) == static_cast<unsigned char>(b);
         });
}

// Decodes all rows. The picture grows by those that were decoded, so that a header alone does not
// make this program allocate much.
Image read_all(RowReader& reader) {
  Image image{reader.width(), reader.height(), {}};
  const std::size_t row_bytes = reader.width() * pixel_bytes(reader.type());
  std::vector<std::byte> stored(kRows * row_bytes);
  for (unsigned row = 0; row < image.height; row += kRows) {
    const unsigned rows = std::min(kRows, image.height - row);
    const std::span<std::byte> part = std::span(stored).first(rows * row_bytes);
    reader.read(rows, part);
    const std::size_t done = image.pixels.size();
    image.pixels.resize(done + std::size_t{rows} * image.width);
    make_linear(reader.type(), part, std::span(image.pixels).subspan(done));
  }
  return image;
}

}  // namespace

std::unique_ptr<RowReader> open_picture(const ByteRange& bytes, const std::string& name,
                                        const PictureLimits& limits, Channels channels) {
  std::array<std::byte, 16> head{};
  const std::span<std::byte> first =
      std::span(head).first(std::min<std::uint64_t>(head.size(), bytes.size()));
  bytes.read(0, first);
  const bool is_tga = lower_extension(name) == ".tga", is_bmp = begins_with(first, "BM");
  if (begins_with(first, "\x89PNG\r\n\x1a\n")) return open_png(bytes, name, limits, channels);
  const bool for_alpha = channels == Channels::alpha;
  if (begins_with(first, "\x76\x2f\x31\x01") && bytes.whole_file() != nullptr)
    return for_alpha ? nullptr : open_exr(bytes.whole_file()->path(), limits);
  if (begins_with(first, "\xff\xd8")) return for_alpha ? nullptr : open_jpeg(bytes, name, limits);
  if (begins_with(first, "#?RADIANCE\n") || begins_with(first, "#?RGBE\n"))
    return for_alpha ? nullptr : open_hdr(bytes, name, limits);
  if (is_tga || is_bmp) return open_by_stb(bytes, name, !is_bmp, limits, channels);
  throw DataError(name + ": not a PNG, JPEG, BMP, HDR, TGA or EXR picture");
}

void check_picture_size(std::uint64_t width, std::uint64_t height, std::uint64_t file_bytes,
                        const PictureLimits& limits, const std::string& name) {
  const std::string size = std::to_string(width) + " x " + std::to_string(height) + " pixels";
  const auto refuse = [&](const std::string& rule) { throw DataError(name + ": " + rule); };
  if (width == 0 || height == 0) refuse("the picture has no pixels");
  if (!is_image_size(width, height)) refuse(size + " are more than this program accepts");
  if (width * height > limits.max_pixels) {
    refuse(size + " are more than the " + std::to_string(limits.max_pixels) +
           " that may still be loaded");
  }
  if (width * height / 8448 > file_bytes)
    refuse(size + " cannot come from " + std::to_string(file_bytes) + " bytes");
}

void check_picture_memory(std::uint64_t bytes, const char* why, const PictureLimits& limits,
                          const std::string& name) {
  if (bytes <= limits.memory_bytes) return;
  constexpr std::uint64_t kMiB = 1 << 20;
  throw LimitError(name + ": " + why + " takes " + std::to_string((bytes + kMiB - 1) / kMiB) +
                   "M to decode, and pictures may take " +
                   std::to_string(limits.memory_bytes / kMiB) +
                   "M of `run.memory_bytes`: raise it, or store the picture by rows");
}

Image decode_image(std::span<const std::byte> bytes, const std::string& name,
                   std::uint64_t max_pixels) {
  return read_all(*open_picture(ByteRange(bytes), name, {.max_pixels = max_pixels}));
}

Image read_image(const std::filesystem::path& path, std::uint64_t max_pixels) {
  const InputFile file(path);
  return read_all(
      *open_picture(ByteRange(file, 0, file.size()), path.string(), {.max_pixels = max_pixels}));
}

}  // namespace ptc
