// BMP and TGA pictures, decoded as a whole through stb.
//
// stb takes a missing end for zeros, so it would read a truncated picture as one with a black part.
// So each format is walked first without decoding it, far enough to find where its picture ends:
//
//   BMP    height x rows behind the data offset     TGA   pixels or packets of run lengths
#include <algorithm>
#include <memory>
#include <vector>

#include <stb_image.h>

#include "engine/base/error.h"
#include "engine/io/image/row_reader.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 30;  // because stb counts in int

struct StbFree {
  void operator()(void* pixels) const noexcept { stbi_image_free(pixels); }
};

// Reads bytes from front to back. Past the end it returns zeros and remembers that it did.
class Cursor {
 public:
  Cursor(std::span<const std::byte> bytes, std::size_t at) : bytes_(bytes), at_(at) {}

  [[nodiscard]] bool past_end() const noexcept { return past_end_ || at_ > bytes_.size(); }
  unsigned u8() {
    if (at_ >= bytes_.size()) {
      past_end_ = true;
      return 0;
    }
    return std::to_integer<unsigned>(bytes_[at_++]);
  }
  unsigned u16_little() {
    const unsigned low = u8();
    return low | u8() << 8;
  }
  std::uint32_t u32_little() {
    const std::uint32_t low = u16_little();
    return low | static_cast<std::uint32_t>(u16_little()) << 16;
  }
  void skip(std::uint64_t count) {
    if (count > bytes_.size() - std::min(at_, bytes_.size())) {
      past_end_ = true;
      at_ = bytes_.size();
    } else {
      at_ += static_cast<std::size_t>(count);
    }
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_;
  bool past_end_ = false;
};

// Walks the pixels or packets of a TGA. Source: Truevision TGA File Format Specification 2.0,
// fields 1 to 8.
bool tga_is_complete(std::span<const std::byte> bytes) {
  // Read the header.
  Cursor at(bytes, 0);
  const unsigned id_bytes = at.u8();
  const bool has_palette = at.u8() == 1;
  const unsigned type = at.u8();
  at.u16_little();
  const unsigned palette_length = at.u16_little();
  const unsigned palette_bits = at.u8();
  at.skip(4);
  const std::uint64_t width = at.u16_little();
  const std::uint64_t height = at.u16_little();
  const unsigned pixel_bytes = (at.u8() + 7) / 8;
  at.u8();
  at.skip(id_bytes + (has_palette ? palette_length * ((palette_bits + 7) / 8) : 0));

  // Pass over the pixels, plain or in packets.
  if (type < 8) {
    at.skip(width * height * pixel_bytes);
    return !at.past_end();
  }
  for (std::uint64_t done = 0; done < width * height && !at.past_end();) {
    const unsigned packet = at.u8();
    const std::uint64_t count = (packet & 127) + 1;
    at.skip(packet >= 128 ? pixel_bytes : count * pixel_bytes);
    done += count;
  }
  return !at.past_end();
}

// Checks the end of the rows of a BMP, as its header gives their place and size.
bool bmp_is_complete(std::span<const std::byte> bytes) {
  Cursor at(bytes, 10);
  const std::uint64_t data_offset = at.u32_little();
  const bool old = at.u32_little() == 12;  // BITMAPCOREHEADER
  const std::uint64_t width = old ? at.u16_little() : at.u32_little();
  const std::uint32_t signed_height = old ? at.u16_little() : at.u32_little();
  const std::uint64_t height =
      signed_height >> 31 != 0 ? std::uint64_t{~signed_height} + 1 : signed_height;
  at.u16_little();
  const std::uint64_t row = (width * at.u16_little() + 31) / 32 * 4;
  Cursor data(bytes, 0);
  data.skip(data_offset);
  data.skip(row * height);
  return !at.past_end() && !data.past_end();
}

class StbReader final : public RowReader {
 public:
  StbReader(const ByteRange& bytes, const std::string& name, bool is_tga,
            const PictureLimits& limits, Channels channels) {
    const auto refuse = [&](const std::string& rule) { throw DataError(name + ": " + rule); };
    if (bytes.size() > kMaxFileBytes) refuse("the picture has more than 1 GiB");
    check_picture_memory(bytes.size(), kWhy, limits, name);
    std::vector<std::byte> file(bytes.size());
    bytes.read(0, file);
    const auto* data = reinterpret_cast<const stbi_uc*>(file.data());
    const int size = static_cast<int>(file.size());
    int width = 0, height = 0;
    if (stbi_info_from_memory(data, size, &width, &height, nullptr) == 0)
      refuse(stbi_failure_reason());
    if (width < 0 || height < 0) refuse("the picture has no pixels");
    width_ = static_cast<unsigned>(width);
    height_ = static_cast<unsigned>(height);
    check_picture_size(width_, height_, file.size(), limits, name);
    const std::size_t pixels = std::size_t{width_} * height_;
    const bool alpha = channels == Channels::alpha;
    const int components = alpha ? 4 : 3;
    constexpr std::uint64_t kPixel = 4 + 3;  // as stb decodes it, and as it is kept
    check_picture_memory(file.size() + kPixel * pixels, kWhy, limits, name);
    if (!(is_tga ? tga_is_complete(file) : bmp_is_complete(file)))
      refuse("offset " + std::to_string(file.size()) + ": the picture ends too early");
    const std::unique_ptr<stbi_uc, StbFree> decoded(
        stbi_load_from_memory(data, size, &width, &height, nullptr, components));
    if (!decoded) refuse(stbi_failure_reason());
    const auto stored =
        std::as_bytes(std::span(decoded.get(), static_cast<std::size_t>(components) * pixels));
    if (alpha) {
      type_ = PixelType::share8;
      std::vector<std::byte> shares(pixels);
      take_alpha(stored, shares);
      rows_ = WholeRows(std::move(shares));
    } else {
      rows_ = WholeRows({stored.begin(), stored.end()});
    }
  }

  void read(unsigned /*rows*/, std::span<std::byte> out) override { rows_.take(out); }

 private:
  static constexpr const char* kWhy = "a BMP or TGA";
  WholeRows rows_;
};

}  // namespace

std::unique_ptr<RowReader> open_by_stb(const ByteRange& bytes, const std::string& name, bool is_tga,
                                       const PictureLimits& limits, Channels channels) {
  return std::make_unique<StbReader>(bytes, name, is_tga, limits, channels);
}

}  // namespace ptc
