// Walks the headers of an EXR before the library reads them, because the library allocates whatever
// the sizes in a header ask for. Source: "OpenEXR File Layout", sections Header and Multi-Part
// Files.
//
//   | magic | version | header of part 0 | header of part 1 | ... | 0 |      0 if there are several
//
//   header:     | attribute | attribute | ... | 0 |
//   attribute:  | name, 0 | type, 0 | u32 size | value, size bytes |
//
// The library reads the values of some types by the size of the type and ignores the declared one.
// If the two differ, it takes what follows for names and sizes that were not checked here. So the
// walk demands that they agree.
#include "engine/io/image/exr_check.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/image/image.h"
#include "engine/io/text/byte_stream.h"

namespace ptc {
namespace {

constexpr std::uint32_t kMultiPart = 0x1000;  // bit of the version field
constexpr std::size_t kMaxName = 255;
constexpr std::int64_t kMaxTileSide = 8192;  // pixels

// Types whose values the library reads by these sizes, whatever size the attribute declares.
constexpr std::array<std::pair<std::string_view, std::uint32_t>, 24> kTypeBytes = {
    {{"box2f", 16},
     {"box2i", 16},
     {"chromaticities", 32},
     {"compression", 1},
     {"deepImageState", 1},
     {"double", 8},
     {"envmap", 1},
     {"float", 4},
     {"int", 4},
     {"keycode", 28},
     {"lineOrder", 1},
     {"m33d", 72},
     {"m33f", 36},
     {"m44d", 128},
     {"m44f", 64},
     {"rational", 8},
     {"tiledesc", 9},
     {"timecode", 8},
     {"v2d", 16},
     {"v2f", 8},
     {"v2i", 8},
     {"v3d", 24},
     {"v3f", 12},
     {"v3i", 12}}};

// Says whether a value of this type may take `size` bytes.
bool suits(std::string_view type, std::uint32_t size) {
  if (type == "floatvector") return size % 4 == 0;
  const auto* const found =
      std::ranges::find(kTypeBytes, type, [](const auto& t) { return t.first; });
  return found == kTypeBytes.end() || found->second == size;
}

class HeaderWalk {
 public:
  HeaderWalk(const std::filesystem::path& path, std::uint64_t max_pixels)
      : stream_(path), bytes_(stream_.max_left()), max_pixels_(max_pixels) {}

  void run() {
    stream_.skip(4);  // the magic number, which the caller has checked
    const bool several = (u32() & kMultiPart) != 0;
    bool more = read_part();
    while (several && more) more = read_part();
  }

 private:
  std::uint32_t u32() {
    const auto bytes = stream_.take(4);
    std::uint32_t value = 0;
    for (std::size_t i = 4; i > 0; --i)
      value = value << 8 | std::to_integer<std::uint32_t>(bytes[i - 1]);
    return value;
  }
  std::int64_t i32() { return static_cast<std::int32_t>(u32()); }

  // Reads a name up to its NUL.
  std::string name() {
    std::string text;
    for (;;) {
      const auto c = std::to_integer<char>(stream_.take(1)[0]);
      if (c == '\0') return text;
      if (text.size() == kMaxName) stream_.fail_at(stream_.offset(), "EXR: a name has no end");
      text.push_back(c);
    }
  }

  // Reads the attributes of a part up to an empty name. Returns false for an empty header, which
  // ends the headers of several parts.
  bool read_part() {
    window_ = {};
    tile_ = {};
    std::string attribute = name();
    if (attribute.empty()) return false;
    for (; !attribute.empty(); attribute = name()) {
      const std::string type = name();
      const std::uint32_t size = u32();
      if (size > stream_.max_left()) {
        stream_.fail_at(stream_.offset(),
                        "EXR: attribute '" + attribute + "' reaches past the end of the file");
      }
      const std::uint64_t end = stream_.offset() + size;
      if (!suits(type, size)) {
        stream_.fail_at(stream_.offset(),
                        "EXR: attribute '" + attribute + "' does not have the size of its type");
      }
      const bool whole = read_value(attribute, type, end);
      if (stream_.offset() > end || (whole && stream_.offset() < end)) {
        stream_.fail_at(end, "EXR: attribute '" + attribute + "' does not have its declared size");
      }
      stream_.skip(end - stream_.offset());
    }
    check_sizes();
    return true;
  }

  // Reads the values that matter. Returns true when the value was read to its own end, as the
  // library does for types whose declared size it ignores.
  bool read_value(const std::string& attribute, const std::string& type, std::uint64_t end) {
    if (attribute == "dataWindow" && type == "box2i") {
      const std::int64_t low_x = i32();
      const std::int64_t low_y = i32();
      const std::int64_t high_x = i32();
      window_ = {high_x - low_x + 1, i32() - low_y + 1};
    } else if (attribute == "tiles" && type == "tiledesc") {
      const std::int64_t width = u32();
      tile_ = {width, u32()};
    } else if (type == "chlist") {
      // Read channels up to an empty name.
      constexpr std::uint64_t kChannelBytes = 16;  // type, linearity, sampling
      while (!name().empty()) stream_.skip(kChannelBytes);
      return true;
    } else if (type == "preview") {
      // Read width, height and 4 bytes for each pixel.
      const std::uint64_t width = u32();
      const std::uint64_t height = u32();
      const std::uint64_t room = (end - std::min(end, stream_.offset())) / 4;
      if (width > room || (width > 0 && height > room / width)) {
        stream_.fail_at(stream_.offset(), "EXR: a preview is larger than its attribute");
      }
      stream_.skip(4 * width * height);
      return true;
    } else if (type == "stringvector") {
      // Read a length and that many bytes for each string.
      while (stream_.offset() < end) {
        const std::uint64_t length = u32();
        if (length > end - std::min(end, stream_.offset())) {
          stream_.fail_at(stream_.offset(), "EXR: a string is longer than its attribute");
        }
        stream_.skip(length);
      }
    }
    return false;
  }

  // Checks the size of the picture and the number of its tiles, for each of which the library
  // allocates an entry of 8 bytes before it reads them.
  void check_sizes() const {
    const auto [width, height] = window_;
    if (width < 1 || height < 1) fail("the picture has no pixels");
    if (!is_image_size(static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height))) {
      fail("the picture has more pixels than this program accepts");
    }
    if (static_cast<std::uint64_t>(width * height) > max_pixels_) {
      fail("the picture has more pixels than the " + std::to_string(max_pixels_) +
           " that may still be loaded");
    }
    const auto [tile_width, tile_height] = tile_;
    if (tile_width == 0 && tile_height == 0) return;
    if (tile_width < 1 || tile_height < 1 || tile_width > kMaxTileSide ||
        tile_height > kMaxTileSide) {
      fail("the tiles have a size that this program does not accept");
    }
    const std::int64_t tiles =
        ((width + tile_width - 1) / tile_width) * ((height + tile_height - 1) / tile_height);
    if (static_cast<std::uint64_t>(tiles) > bytes_ / 8)
      fail("the picture has more tiles than the file can hold");
  }

  [[noreturn]] void fail(const std::string& rule) const {
    stream_.fail_at(stream_.offset(), "EXR: " + rule);
  }

  ByteStream stream_;
  std::uint64_t bytes_;  // size of the file
  std::uint64_t max_pixels_;
  std::array<std::int64_t, 2> window_{};  // width and height of the data window of a part
  std::array<std::int64_t, 2> tile_{};    // width and height of its tiles; 0 without tiles
};

}  // namespace

void check_exr_headers(const std::filesystem::path& path, std::uint64_t max_pixels) {
  HeaderWalk(path, max_pixels).run();
}

}  // namespace ptc
