// Pictures that stb decodes, and the choice of the reader.
//
// stb trusts the sizes in a file and fills in what is missing. So a file passes three gates before
// it is decoded: raster_format() by its first bytes, check_size() by its width and height, and
// check_raster() by its end.
#include "engine/io/image/image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>

#include <stb_image.h>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/image/image_formats.h"
#include "engine/io/image/srgb.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 30;  // because stb counts in int

struct StbFree {
  void operator()(void* pixels) const noexcept { stbi_image_free(pixels); }
};

[[noreturn]] void refuse(const std::string& name, const std::string& rule) {
  throw DataError(name + ": " + rule);
}

// Returns the linear value of each 16-bit sRGB value.
const std::vector<float>& linear_of_16_bit() {
  static const std::vector<float> table = [] {
    std::vector<float> values(65536);
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(srgb_to_linear(static_cast<double>(i) / 65535));
    }
    return values;
  }();
  return table;
}

// Checks the size of a picture before it is allocated. Deflate, the end-of-band runs of JPEG and
// run lengths make fewer than 8448 pixels of a byte (in a 1-bit PNG), so a small file cannot ask
// for a large allocation.
void check_size(int width, int height, std::size_t file_bytes, std::uint64_t max_pixels,
                const std::string& name) {
  if (width < 1 || height < 1) refuse(name, "the picture has no pixels");
  const auto w = static_cast<std::uint64_t>(width);
  const auto h = static_cast<std::uint64_t>(height);
  const std::string size = std::to_string(w) + " x " + std::to_string(h) + " pixels";
  if (!is_image_size(w, h)) refuse(name, size + " are more than this program accepts");
  if (w * h > max_pixels) {
    refuse(name,
           size + " are more than the " + std::to_string(max_pixels) + " that may still be loaded");
  }
  if (w * h / 8448 > file_bytes) {
    refuse(name, size + " cannot come from " + std::to_string(file_bytes) + " bytes");
  }
}

// Replaces negative and non-finite values by 0.
glm::vec3 sane(glm::vec3 value) {
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(value[i]) || value[i] < 0) value[i] = 0;
  }
  return value;
}

Image decode_hdr(const stbi_uc* data, int bytes, const std::string& name) {
  int width = 0;
  int height = 0;
  const std::unique_ptr<float, StbFree> values(
      stbi_loadf_from_memory(data, bytes, &width, &height, nullptr, 3));
  if (!values) refuse(name, stbi_failure_reason());
  Image image{static_cast<unsigned>(width), static_cast<unsigned>(height), {}};
  image.pixels.resize(std::size_t{image.width} * image.height);
  const float* from = values.get();
  for (glm::vec3& pixel : image.pixels) {
    pixel = sane({from[0], from[1], from[2]});
    from += 3;
  }
  return image;
}

Image decode_integers(const stbi_uc* data, int bytes, const std::string& name) {
  int width = 0;
  int height = 0;
  const std::unique_ptr<stbi_us, StbFree> values(
      stbi_load_16_from_memory(data, bytes, &width, &height, nullptr, 3));
  if (!values) refuse(name, stbi_failure_reason());
  Image image{static_cast<unsigned>(width), static_cast<unsigned>(height), {}};
  image.pixels.resize(std::size_t{image.width} * image.height);
  const std::vector<float>& linear = linear_of_16_bit();
  const stbi_us* from = values.get();
  for (glm::vec3& pixel : image.pixels) {
    pixel = {linear[from[0]], linear[from[1]], linear[from[2]]};
    from += 3;
  }
  return image;
}

}  // namespace

Image decode_image(std::span<const std::byte> bytes, const std::string& name,
                   std::uint64_t max_pixels) {
  const RasterFormat format = raster_format(bytes, name);
  if (format == RasterFormat::none) refuse(name, "not a PNG, JPEG, BMP, HDR, TGA or EXR picture");
  if (bytes.size() > kMaxFileBytes) refuse(name, "the picture has more than 1 GiB");
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  const int size = static_cast<int>(bytes.size());
  int width = 0;
  int height = 0;
  if (stbi_info_from_memory(data, size, &width, &height, nullptr) == 0) {
    refuse(name, stbi_failure_reason());
  }
  check_size(width, height, bytes.size(), max_pixels, name);
  const auto pixels = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  check_raster(bytes, format, pixels, name);
  return format == RasterFormat::hdr ? decode_hdr(data, size, name)
                                     : decode_integers(data, size, name);
}

Image read_image(const std::filesystem::path& path, std::uint64_t max_pixels) {
  const InputFile file(path);
  constexpr std::array kExrMagic = {std::byte{0x76}, std::byte{0x2f}, std::byte{0x31},
                                    std::byte{0x01}};
  std::array<std::byte, 4> magic{};
  if (file.size() >= magic.size()) file.read_at(0, magic);
  if (magic == kExrMagic) return read_exr(path, max_pixels);
  if (file.size() > kMaxFileBytes) refuse(path.string(), "the picture has more than 1 GiB");
  std::vector<std::byte> bytes(file.size());
  file.read_at(0, bytes);
  return decode_image(bytes, path.string(), max_pixels);
}

}  // namespace ptc
