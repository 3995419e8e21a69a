// Finds the raster format of a file, whether its end is missing, and whether it asks for more work
// than a picture needs.
//
// stb takes a missing end for zeros, so it would read a truncated picture as one with a black part.
// Here each format is walked without decoding it, far enough to find where its picture ends:
//
//   JPEG   segments up to the marker FF D9          PNG   chunks up to IEND
//   BMP    height x rows behind the data offset     TGA   pixels or packets of run lengths
//   HDR    lines of run lengths
#include <algorithm>
#include <optional>
#include <string_view>

#include "engine/base/error.h"
#include "engine/io/image/image_formats.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

// The greatest number of scans in a JPEG, because stb decodes each scan over the whole picture,
// even an empty one. Encoders write about ten scans; cjpeg of libjpeg reads scripts of at most 100
// (rdswitch.c).
constexpr std::uint64_t kMaxScans = 100;
// The greatest number of pixels in all scans of a JPEG. Ten scans of the largest picture fit; they
// take about half a minute.
constexpr std::uint64_t kMaxScannedPixels = std::uint64_t{1} << 32;

constexpr char kTooEarly[] = "the picture ends too early";

// The reason why a picture is refused.
struct Fault {
  std::size_t offset;
  const char* rule;
};

// Reads bytes from front to back. Past the end it returns zeros and remembers that it did.
class Cursor {
 public:
  Cursor(std::span<const std::byte> bytes, std::size_t at) : bytes_(bytes), at_(at) {}

  [[nodiscard]] std::size_t offset() const noexcept { return at_; }
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
  unsigned u16_big() {
    const unsigned high = u8();
    return high << 8 | u8();
  }
  std::uint32_t u32_little() {
    const std::uint32_t low = u16_little();
    return low | static_cast<std::uint32_t>(u16_little()) << 16;
  }
  std::uint32_t u32_big() {
    const std::uint32_t high = u16_big();
    return high << 16 | u16_big();
  }
  void skip(std::uint64_t count) {
    if (count > bytes_.size() - std::min(at_, bytes_.size())) {
      past_end_ = true;
      at_ = bytes_.size();
    } else {
      at_ += static_cast<std::size_t>(count);
    }
  }
  // Reads a line and returns it up to a NUL, which ends a line for stb.
  std::string_view line() {
    const auto* begin = reinterpret_cast<const char*>(bytes_.data());
    const std::string_view rest(begin + at_, bytes_.size() - at_);
    const std::size_t length = rest.find('\n');
    skip(length == std::string_view::npos ? bytes_.size() : length + 1);
    return rest.substr(0, std::min(length, rest.find('\0')));
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_;
  bool past_end_ = false;
};

// Walks the segments of a JPEG up to the end-of-image marker. Behind a start of scan come
// entropy-coded bytes, in which FF is followed by 00 or a restart marker. Source: ITU-T T.81,
// B.1.1.
std::optional<Fault> jpeg_fault(std::span<const std::byte> bytes, std::uint64_t pixels) {
  constexpr unsigned kStartOfScan = 0xda;
  Cursor at(bytes, 2);
  std::uint64_t scans = 0;
  bool in_scan = false;
  while (!at.past_end()) {
    const std::size_t offset = at.offset();
    if (at.u8() != 0xff) {
      if (!in_scan) return std::nullopt;  // not a marker: the decoder will say so
      continue;
    }
    unsigned marker = at.u8();
    while (marker == 0xff) marker = at.u8();
    if (marker == 0xd9 && !at.past_end()) return std::nullopt;
    if (marker == 0 || (marker >= 0xd0 && marker <= 0xd7)) continue;
    in_scan = marker == kStartOfScan;
    if (in_scan && ++scans > kMaxScans) return Fault{offset, "the JPEG has more than 100 scans"};
    if (in_scan && scans * pixels > kMaxScannedPixels) {
      return Fault{offset, "the scans of the JPEG have more than 2^32 pixels together"};
    }
    const unsigned length = at.u16_big();
    at.skip(std::max(2U, length) - 2);
  }
  return Fault{bytes.size(), kTooEarly};
}

// Walks the chunks of a PNG, of length, type, data and checksum, up to the one that ends the
// picture. Source: W3C, PNG, section 5.3.
bool png_is_complete(std::span<const std::byte> bytes) {
  constexpr std::uint32_t kEnd = 0x49454e44;  // "IEND"
  Cursor at(bytes, 8);
  while (!at.past_end()) {
    const std::uint32_t length = at.u32_big();
    const std::uint32_t type = at.u32_big();
    at.skip(std::uint64_t{length} + 4);
    if (type == kEnd) break;
  }
  return !at.past_end();
}

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

// Passes over a run-length coded line: four channels of `width` bytes. Runs of length zero are
// skipped as in stb, which takes the zeros past the end of a file for such runs and never returns.
void skip_hdr_line(Cursor& at, std::uint64_t width) {
  for (int channel = 0; channel < 4; ++channel) {
    for (std::uint64_t done = 0; done < width && !at.past_end();) {
      const unsigned packet = at.u8();
      const unsigned count = packet > 128 ? packet - 128 : packet;
      at.skip(packet > 128 ? 1 : count);
      done += count;
    }
  }
}

// Reads "-Y HEIGHT +X WIDTH", the only order that stb accepts.
std::optional<std::array<std::uint64_t, 2>> hdr_size(std::string_view line) {
  std::array<std::uint64_t, 2> size{};
  std::size_t part = 0;
  bool in_number = false;
  for (const char c : line) {
    const bool digit = c >= '0' && c <= '9';
    if (digit && part < 2 && size[part] < kMaxImagePixels) {
      size[part] = size[part] * 10 + static_cast<std::uint64_t>(c - '0');
    }
    if (in_number && !digit) ++part;
    in_number = digit;
  }
  if (in_number) ++part;
  if (part != 2) return std::nullopt;
  return size;
}

// Walks the lines of an HDR. Source: Ward, "Real Pixels", Graphics Gems II, 1991; new run lengths
// as in Radiance's color.c.
bool hdr_is_complete(std::span<const std::byte> bytes) {
  Cursor at(bytes, 0);
  while (!at.line().empty()) {
    if (at.past_end()) return false;
  }
  const auto size = hdr_size(at.line());
  if (!size) return false;
  const auto [height, width] = *size;
  if (width < 8 || width >= 32768) {
    at.skip(width * height * 4);
    return !at.past_end();
  }
  for (std::uint64_t y = 0; y < height && !at.past_end(); ++y) {
    const bool coded = at.u8() == 2 && at.u8() == 2 && (at.u8() & 128) == 0;
    if (!coded && y == 0) {  // stb decides by the first line only
      at.skip(width * height * 4 - 3);
      break;
    }
    at.u8();
    skip_hdr_line(at, width);
  }
  return !at.past_end();
}

bool begins_with(std::span<const std::byte> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() &&
         std::ranges::equal(bytes.first(magic.size()), magic, [](std::byte a, char b) {
           return std::to_integer<unsigned char>(a) == static_cast<unsigned char>(b);
         });
}

}  // namespace

RasterFormat raster_format(std::span<const std::byte> bytes, const std::string& name) {
  if (begins_with(bytes, "\x89PNG\r\n\x1a\n")) return RasterFormat::png;
  if (begins_with(bytes, "\xff\xd8")) return RasterFormat::jpeg;
  if (begins_with(bytes, "#?RADIANCE\n") || begins_with(bytes, "#?RGBE\n")) {
    return RasterFormat::hdr;
  }
  if (begins_with(bytes, "BM")) return RasterFormat::bmp;
  return lower_extension(name) == ".tga" ? RasterFormat::tga : RasterFormat::none;
}

void check_raster(std::span<const std::byte> bytes, RasterFormat format, std::uint64_t pixels,
                  const std::string& name) {
  const auto complete = [&](bool whole) {
    return whole ? std::nullopt : std::optional(Fault{bytes.size(), kTooEarly});
  };
  std::optional<Fault> fault;
  switch (format) {
    case RasterFormat::jpeg:
      fault = jpeg_fault(bytes, pixels);
      break;
    case RasterFormat::tga:
      fault = complete(tga_is_complete(bytes));
      break;
    case RasterFormat::bmp:
      fault = complete(bmp_is_complete(bytes));
      break;
    case RasterFormat::hdr:
      fault = complete(hdr_is_complete(bytes));
      break;
    case RasterFormat::png:
      fault = complete(png_is_complete(bytes));
      break;
    case RasterFormat::none:
      break;
  }
  if (!fault) return;
  throw DataError(name + ": offset " + std::to_string(fault->offset) + ": " + fault->rule);
}

}  // namespace ptc
