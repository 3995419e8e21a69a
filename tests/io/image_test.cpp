// 8-bit pictures: the sRGB curve, the formats, and what damaged files do.
#include "engine/io/image/image.h"

#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <span>
#include <stdexcept>
#include <system_error>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/common.hpp>
#include <zlib.h>

#include "engine/base/error.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

// Returns the linear value of an 8-bit one, independently of the library's own curve.
double linear(int stored) {
  const double s = stored / 255.0;
  return s < 0.04045 ? s / 12.92 : std::exp(2.4 * std::log((s + 0.055) / 1.055));
}

Image decode(std::string_view bytes, const std::string& name) {
  return decode_image(std::as_bytes(std::span(bytes.data(), bytes.size())), name);
}

// A picture of 2 x 2 pixels, rows from the top: red, green / blue, white.
void check_four_colours(const Image& image, double tolerance = 1e-6) {
  REQUIRE(image.width == 2);
  REQUIRE(image.height == 2);
  const auto is = [&](unsigned x, unsigned y, glm::vec3 colour) {
    for (int i = 0; i < 3; ++i) {
      CHECK(static_cast<double>(image.at(x, y)[i]) ==
            Approx(static_cast<double>(colour[i])).margin(tolerance));
    }
  };
  is(0, 0, {1, 0, 0});
  is(1, 0, {0, 1, 0});
  is(0, 1, {0, 0, 1});
  is(1, 1, {1, 1, 1});
}

std::string tga_header(int type, int width, int height) {
  std::string bytes(18, '\0');
  bytes[2] = static_cast<char>(type);
  bytes[12] = static_cast<char>(width);
  bytes[14] = static_cast<char>(height);
  bytes[16] = 24;
  bytes[17] = 0x20;  // rows from the top
  return bytes;
}

const std::string kBgr("\0\0\xff\0\xff\0\xff\0\0\xff\xff\xff", 12);

std::string four_colours_tga() {
  return tga_header(2, 2, 2) + kBgr;
}

std::string four_colours_tga_rle() {
  // One packet of three different pixels, and one packet that repeats a pixel.
  return tga_header(10, 2, 2) + std::string("\x02") + kBgr.substr(0, 9) + std::string("\x80") +
         kBgr.substr(9);
}

std::string four_colours_bmp() {
  std::string rows =
      kBgr.substr(6, 6) + std::string(2, '\0') + kBgr.substr(0, 6) + std::string(2, '\0');
  return "BM" + raw<std::uint32_t>(70) + raw<std::uint32_t>(0) + raw<std::uint32_t>(54) +
         raw<std::uint32_t>(40) + raw<std::int32_t>(2) + raw<std::int32_t>(2) +
         raw<std::uint16_t>(1) + raw<std::uint16_t>(24) + std::string(24, '\0') + rows;
}

// The Radiance format: mantissas and a common exponent; 2^(129 - 136) * 128 = 1.
std::string four_colours_hdr() {
  return "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n" +
         std::string("\x80\0\0\x81\0\x80\0\x81\0\0\x80\x81\x80\x80\x80\x81", 16);
}

// Eight equal pixels in each row, run-length coded.
std::string coded_hdr() {
  std::string row("\x02\x02\x00\x08", 4);
  for (const char* run : {"\x88\x80", "\x88\x80", "\x88\x80", "\x88\x81"}) row.append(run, 2);
  return "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n" + row + row;
}

struct GreyJpeg {
  int side = 8;
  int scans = 1;
  int comments = 0;  // bytes
  bool progressive = true;
};

// Appends a marker and its segment.
std::string segment(char marker, const std::string& bytes) {
  const std::size_t length = bytes.size() + 2;
  return std::string{'\xff', marker, static_cast<char>(length >> 8), static_cast<char>(length)} +
         bytes;
}

// A JPEG whose scans are all empty: missing bits are read as zeros, each the code of "no change".
std::string grey_jpeg(const GreyJpeg& jpeg) {
  const std::string code = std::string("\1") + std::string(16, '\0');
  const std::string side{static_cast<char>(jpeg.side >> 8), static_cast<char>(jpeg.side)};
  std::string bytes = "\xff\xd8" + segment('\xdb', std::string(1, '\0') + std::string(64, '\1'));
  bytes += segment(jpeg.progressive ? '\xc2' : '\xc0',
                   "\x08" + side + side + std::string("\1\1\x11\0", 4));
  bytes += segment('\xc4', std::string(1, '\0') + code) + segment('\xc4', "\x10" + code);
  if (jpeg.comments > 0) {
    bytes += segment('\xfe', std::string(static_cast<std::size_t>(jpeg.comments), ' '));
  }
  for (int i = 0; i < jpeg.scans; ++i) {
    bytes += segment('\xda', std::string("\1\1\0\0", 4) + (jpeg.progressive ? '\0' : '\x3f') +
                                 std::string(1, '\0'));
  }
  return bytes + "\xff\xd9";
}

Image gradient() {
  Image image{16, 16, {}};
  for (int i = 0; i < 256; ++i) {
    image.pixels.emplace_back(linear(i), linear(255 - i), linear(i / 2));
  }
  return image;
}

}  // namespace

TEST_CASE("png: all 256 values are read back as written", "[io][image]") {
  const test::TemporaryDirectory scratch;
  const Image image = gradient();
  write_png(scratch.path() / "a.png", image);
  CHECK(scratch.listing() == "a.png");
  const Image back = read_image(scratch.path() / "a.png");
  REQUIRE(back.width == 16);
  REQUIRE(back.height == 16);
  for (std::size_t i = 0; i < 256; ++i) {
    const glm::vec3 difference = glm::abs(back.pixels[i] - image.pixels[i]);
    CHECK(difference.x < 1e-6F);
    CHECK(difference.y < 1e-6F);
    CHECK(difference.z < 1e-6F);
  }
}

TEST_CASE("png: values outside [0, 1] are clamped, and NaN is black", "[io][image]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", {2, 1, {{-1, 2, NAN}, {INFINITY, -INFINITY, 0.5F}}});
  const Image back = read_image(scratch.path() / "a.png");
  CHECK(back.at(0, 0) == glm::vec3(0, 1, 0));
  CHECK(back.at(1, 0).x == 1);
  CHECK(back.at(1, 0).y == 0);
  CHECK(static_cast<double>(back.at(1, 0).z) == Approx(linear(188)));
}

TEST_CASE("png: sizes that do not match the pixels are refused", "[io][image]") {
  const test::TemporaryDirectory scratch;
  CHECK_THROWS_AS(write_png(scratch.path() / "a.png", {2, 2, {glm::vec3(0)}}),
                  std::invalid_argument);
  CHECK_THROWS_AS(write_png(scratch.path() / "a.png", {}), std::invalid_argument);
  CHECK_THROWS_AS(write_png(scratch.path() / "a.png", {65537, 1, std::vector<glm::vec3>(65537)}),
                  std::invalid_argument);
  CHECK(scratch.listing().empty());
}

TEST_CASE("png: rows that come a few at a time make the file that all at once make",
          "[io][image]") {
  const test::TemporaryDirectory scratch;
  const Image image = gradient();
  const std::span<const glm::vec3> pixels = image.pixels;
  write_png(scratch.path() / "whole.png", image);
  PngWriter writer(scratch.path() / "parts.png", 16, 16);
  writer.write(pixels.first(16));
  CHECK_THROWS_AS(writer.write(pixels.first(15)), std::invalid_argument);
  CHECK_THROWS_AS(writer.publish(), std::invalid_argument);
  writer.write(pixels.subspan(16));
  CHECK_THROWS_AS(writer.write(pixels.first(16)), std::invalid_argument);
  writer.publish();
  CHECK(scratch.listing() == "parts.png whole.png");
  CHECK(slurp(scratch.path() / "parts.png") == slurp(scratch.path() / "whole.png"));
}

TEST_CASE("png: a disk that is full is told, and leaves no file", "[io][image]") {
  // 300 x 300 pixels of noise do not fit the limit on the size of files
  const test::TemporaryDirectory scratch;
  Image image{300, 300, {}};
  std::uint32_t noise = 1;
  for (int i = 0; i < 90'000; ++i) {
    noise = noise * 1664525U + 1013904223U;
    image.pixels.emplace_back(linear(static_cast<int>(noise >> 24)));
  }
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{20'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  CHECK_THROWS_AS(write_png(scratch.path() / "a.png", image), std::system_error);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  CHECK(scratch.listing().empty());
}

TEST_CASE("image: TGA, BMP and HDR give the same four pixels", "[io][image]") {
  check_four_colours(decode(four_colours_tga(), "a.tga"));
  check_four_colours(decode(four_colours_tga_rle(), "a.TGA"));
  check_four_colours(decode(four_colours_bmp(), "a"));
  check_four_colours(decode(four_colours_hdr(), "a"));
  const Image coded = decode(coded_hdr(), "a");
  CHECK(coded.width == 8);
  CHECK(coded.at(7, 1) == glm::vec3(1));
}

TEST_CASE("image: every truncation of every format is refused", "[io][image]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", gradient());
  for (const std::string& whole :
       {slurp(scratch.path() / "a.png"), four_colours_tga(), four_colours_tga_rle(),
        four_colours_bmp(), four_colours_hdr(), coded_hdr()}) {
    CHECK_NOTHROW(decode(whole, "a.tga"));
    for (std::size_t size = 0; size < whole.size(); ++size) {
      CHECK_THROWS_AS(decode(whole.substr(0, size), "a.tga"), DataError);
    }
  }
}

TEST_CASE("image: a flipped byte changes the picture or has it refused, no more", "[io][image]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", {3, 2, std::vector<glm::vec3>(6, glm::vec3(0.5F))});
  for (const std::string& whole :
       {slurp(scratch.path() / "a.png"), four_colours_tga(), four_colours_tga_rle(),
        four_colours_bmp(), four_colours_hdr(), coded_hdr()}) {
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const int flip : {1, 0x80, 0xff}) {
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ flip);
        static_cast<void>(refusal([&] {
          const Image image = decode(damaged, "a.tga");
          if (image.pixels.size() != std::size_t{image.width} * image.height) {
            throw std::logic_error("an image with too few pixels");
          }
        }));
      }
    }
  }
}

TEST_CASE("image: an HDR with empty runs or with two different sizes is refused, and reading ends",
          "[io][image]") {
  const std::string whole = coded_hdr();
  const std::size_t pixels = whole.find("+X 8\n") + 5;
  CHECK_THROWS_AS(decode(whole.substr(0, pixels + 4) + std::string(60, '\0'), "a"), DataError);
  std::string third = whole.substr(0, pixels + 6);
  CHECK_THROWS_AS(decode(third.insert(pixels - 1, " 9"), "a"), DataError);
}

TEST_CASE("png: texts that unpack to much memory are passed over", "[io][image]") {
  // zTXt chunks between header and pixels: 4 MB each
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", gradient());
  const std::string whole = slurp(scratch.path() / "a.png");
  std::vector<Bytef> packed(1 << 16);
  uLongf size = packed.size();
  const std::vector<Bytef> text(4'000'000, 'x');
  REQUIRE(compress(packed.data(), &size, text.data(), text.size()) == Z_OK);
  const std::string body = "zTXt" + std::string("a\0\0", 3) +
                           std::string(reinterpret_cast<const char*>(packed.data()), size);
  const auto big = [](std::uint32_t v) {
    return std::string{static_cast<char>(v >> 24), static_cast<char>(v >> 16),
                       static_cast<char>(v >> 8), static_cast<char>(v)};
  };
  const auto sum =
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  const std::string chunk = big(static_cast<std::uint32_t>(body.size() - 4)) + body +
                            big(static_cast<std::uint32_t>(sum));
  std::string bomb = whole.substr(0, 33);
  for (int i = 0; i < 100; ++i) bomb += chunk;
  bomb += whole.substr(33);
  const auto peak = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;  // KiB
  };
  const long before = peak();
  CHECK(decode(bomb, "a.png").pixels == read_image(scratch.path() / "a.png").pixels);
  CHECK(peak() - before < 100'000);
}

TEST_CASE("jpeg: as many scans as encoders write are read, and more are refused", "[io][image]") {
  CHECK(decode(grey_jpeg({.scans = 1, .progressive = false}), "a").width == 8);
  CHECK(decode(grey_jpeg({.scans = 10}), "a").width == 8);
  CHECK(decode(grey_jpeg({.scans = 100}), "a").width == 8);
  for (const int scans : {101, 20'000}) {
    CHECK_THROWS_WITH(decode(grey_jpeg({.scans = scans}), "a.jpg"),
                      Contains("a.jpg: offset ") && Contains("the JPEG has more than 100 scans"));
  }
  CHECK_THROWS_AS(decode(grey_jpeg({.scans = 2, .progressive = false}), "a"), DataError);
}

TEST_CASE("jpeg: scans of a large picture are refused when they add up to 2^32 pixels",
          "[io][image]") {
  // The comments make the file as large as a picture of this size must be.
  const std::string whole =
      grey_jpeg({.side = 16'384, .scans = 17, .comments = 40'000, .progressive = true});
  CHECK_THROWS_WITH(decode(whole, "a.jpg"),
                    Contains("the scans of the JPEG have more than 2^32 pixels together"));
}

TEST_CASE("image: a small file cannot claim many pixels", "[io][image]") {
  std::string bmp = four_colours_bmp();
  bmp.replace(18, 8, raw<std::int32_t>(60000) + raw<std::int32_t>(4000));
  CHECK_THROWS_WITH(decode(bmp, "a.bmp"), Contains("a.bmp: 60000 x 4000 pixels"));
  bmp.replace(18, 8, raw<std::int32_t>(70000) + raw<std::int32_t>(1));
  CHECK_THROWS_WITH(decode(bmp, "a.bmp"), Contains("more than this program accepts"));
}

TEST_CASE("image: a file that is not a picture is refused by name", "[io][image]") {
  const test::TemporaryDirectory scratch;
  for (const std::string text : {"", "GIF89a......", "hello"}) {
    const auto path = scratch.file("a.png", text);
    CHECK_THROWS_WITH(static_cast<void>(read_image(path)),
                      Contains(path.string() + ": not a PNG, JPEG, BMP, HDR, TGA or EXR"));
  }
  CHECK_THROWS_AS(static_cast<void>(read_image(scratch.path())), std::system_error);
}
