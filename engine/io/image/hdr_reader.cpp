// Radiance pictures (HDR), read row by row. Source: Ward, "Real Pixels", Graphics Gems II, 1991,
// and the run lengths of the format's later version, each row of which begins with 2, 2, width:
//
//   | 2 2 width | red of all pixels | green | blue | exponents |   each as runs and bytes
//   run:   128 + n, value                                           n times the value
//   bytes: n, then n bytes
//
// A row of fewer than 8 or more than 32,767 pixels, or one that does not begin so, has its pixels
// one after another.
#include <array>
#include <optional>
#include <string>

#include "engine/io/image/row_reader.h"

namespace ptc {
namespace {

constexpr std::size_t kChannels = 4;
constexpr unsigned kLeastCoded = 8, kMostCoded = 32'767;  // pixels of a row
constexpr std::size_t kMaxLine = 1000;                    // bytes of a line of the header

class HdrReader final : public RowReader {
 public:
  HdrReader(const ByteRange& bytes, const std::string& name, const PictureLimits& limits)
      : cursor_(bytes, name) {
    type_ = PixelType::rgbe;
    read_header();
    check_picture_size(width_, height_, bytes.size(), limits, name);
  }

  void read(unsigned rows, std::span<std::byte> out) override {
    const std::size_t row_bytes = std::size_t{width_} * kChannels;
    for (unsigned row = 0; row < rows; ++row) read_row(out.subspan(row * row_bytes, row_bytes));
  }

 private:
  std::string line() {
    std::string text;
    for (unsigned c = cursor_.u8(); c != '\n'; c = cursor_.u8()) {
      if (text.size() == kMaxLine) cursor_.fail("HDR: a line of the header has no end");
      text.push_back(static_cast<char>(c));
    }
    if (text.ends_with('\r')) text.pop_back();
    return text;
  }

  void read_header() {
    bool is_rgbe = true;
    for (std::string text = line(); !text.empty(); text = line()) {
      if (text.starts_with("FORMAT=")) is_rgbe = text == "FORMAT=32-bit_rle_rgbe";
    }
    if (!is_rgbe) cursor_.fail("HDR: the pixels are not RGB with an exponent");
    // The rows go from the top down, their pixels from left to right
    const std::string text = line();
    const std::size_t middle = text.find(" +X ");
    const auto height = text.starts_with("-Y ") && middle != std::string::npos
                            ? number(text.substr(3, middle - 3))
                            : std::nullopt;
    const auto width = height ? number(text.substr(middle + 4)) : std::nullopt;
    if (!width) cursor_.fail("HDR: the size is not given as \"-Y HEIGHT +X WIDTH\"");
    width_ = *width;
    height_ = *height;
  }

  static std::optional<unsigned> number(const std::string& text) {
    if (text.empty() || text.size() > 9 ||
        text.find_first_not_of("0123456789") != std::string::npos)
      return std::nullopt;
    return static_cast<unsigned>(std::stoul(text));
  }

  void read_row(std::span<std::byte> out) {
    std::array<std::byte, kChannels> first;
    cursor_.take(first);
    const auto value = [&](std::size_t i) { return std::to_integer<unsigned>(first[i]); };
    const bool coded = width_ >= kLeastCoded && width_ <= kMostCoded && value(0) == 2 &&
                       value(1) == 2 && value(2) < 128;
    if (!coded) {
      std::ranges::copy(first, out.begin());
      return cursor_.take(out.subspan(kChannels));
    }
    if ((value(2) << 8 | value(3)) != width_)
      cursor_.fail("HDR: a row has another width than the picture");
    for (std::size_t channel = 0; channel < kChannels; ++channel) read_channel(channel, out);
  }

  void read_channel(std::size_t channel, std::span<std::byte> out) {
    for (unsigned x = 0; x < width_;) {
      const unsigned code = cursor_.u8();
      const bool is_run = code > 128;
      const unsigned count = is_run ? code - 128 : code;
      if (count == 0 || count > width_ - x) cursor_.fail("HDR: a run is empty or leaves its row");
      unsigned value = is_run ? cursor_.u8() : 0;
      for (const unsigned end = x + count; x < end; ++x) {
        if (!is_run) value = cursor_.u8();
        out[x * kChannels + channel] = static_cast<std::byte>(value);
      }
    }
  }

  ByteCursor cursor_;
};

}  // namespace

std::unique_ptr<RowReader> open_hdr(const ByteRange& bytes, const std::string& name,
                                    const PictureLimits& limits) {
  return std::make_unique<HdrReader>(bytes, name, limits);
}

}  // namespace ptc
