// Writing and reading OpenEXR pictures.
#include <array>
#include <cmath>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <vector>

#include <ImfChannelList.h>
#include <ImfCompression.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <ImfTiledOutputFile.h>
#include <catch2/catch.hpp>
#include <half.h>

#include "engine/base/error.h"
#include "engine/io/image/image.h"
#include "tests/io/files.h"

using namespace ptc;

namespace {

std::vector<float> ramp(std::size_t count) {
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = static_cast<float>(i) * 0.37F;
  return values;
}

struct Picture {
  std::string channels;  // one letter for each
  Imf::Compression compression = Imf::NO_COMPRESSION;
  Imf::PixelType type = Imf::FLOAT;
  Imath::Box2i window = {{-2, 3}, {4, 12}};  // 7 x 10
  unsigned tile = 0;
};

// Returns a picture in which channel c of pixel i has the value 100 c + i.
void write_with_library(const std::filesystem::path& path, const Picture& picture) {
  const auto size = picture.window.size() + Imath::V2i(1);
  const auto count = static_cast<std::size_t>(size.x * size.y);
  Imf::Header header(picture.window, picture.window);
  header.compression() = picture.compression;
  Imf::FrameBuffer buffer;
  std::vector<std::vector<float>> floats;
  std::vector<std::vector<half>> halves;
  std::vector<std::vector<unsigned>> integers;
  for (std::size_t c = 0; c < picture.channels.size(); ++c) {
    floats.emplace_back(count);
    for (std::size_t i = 0; i < count; ++i) floats[c][i] = static_cast<float>(100 * c + i);
    halves.emplace_back(floats[c].begin(), floats[c].end());
    integers.emplace_back(floats[c].begin(), floats[c].end());
  }
  for (std::size_t c = 0; c < picture.channels.size(); ++c) {
    const std::string name(1, picture.channels[c]);
    const void* data = picture.type == Imf::FLOAT  ? static_cast<void*>(floats[c].data())
                       : picture.type == Imf::HALF ? static_cast<void*>(halves[c].data())
                                                   : static_cast<void*>(integers[c].data());
    header.channels().insert(name, Imf::Channel(picture.type));
    buffer.insert(name, Imf::Slice::Make(picture.type, data, picture.window));
  }
  if (picture.tile > 0) {
    header.setTileDescription(Imf::TileDescription(picture.tile, picture.tile));
    Imf::TiledOutputFile file(path.c_str(), header, 0);
    file.setFrameBuffer(buffer);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  } else {
    Imf::OutputFile file(path.c_str(), header, 0);
    file.setFrameBuffer(buffer);
    file.writePixels(size.y);
  }
}

void check_picture(const Image& image, const std::array<float, 3>& base) {
  REQUIRE(image.width == 7);
  REQUIRE(image.height == 10);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(image.pixels[i][static_cast<int>(c)] == base[c] + static_cast<float>(i));
    }
  }
}

}  // namespace

TEST_CASE("exr: a picture with more pixels than the caller allows is refused", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  write_exr(path, 10, 20, {{{}, std::vector<float>(600, 1.0F)}});
  CHECK(read_image(path, 200).width == 10);
  CHECK_THROWS_WITH(
      static_cast<void>(read_image(path, 199)),
      Catch::EndsWith("EXR: the picture has more pixels than the 199 that may still be loaded"));
}

TEST_CASE("exr: a float colour layer is read back bit for bit", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  const std::vector<float> values = ramp(5 * 3 * 3);
  write_exr(path, 5, 3, {{"", ExrLayer::Kind::colour, true, values}});
  CHECK(scratch.listing() == "a.exr");
  const Image image = read_image(path);
  REQUIRE(image.width == 5);
  REQUIRE(image.height == 3);
  for (std::size_t i = 0; i < values.size(); ++i) {
    CHECK(image.pixels[i / 3][static_cast<int>(i % 3)] == values[i]);
  }
}

TEST_CASE("exr: layers have the channels, types and compression that the header promises",
          "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  write_exr(path, 4, 2,
            {{"", ExrLayer::Kind::colour, false, ramp(24)},
             {"occlusion", ExrLayer::Kind::scalar, true, ramp(8)},
             {"bent", ExrLayer::Kind::vector, true, ramp(24)}});
  Imf::InputFile file(path.c_str());
  std::string channels;
  for (auto c = file.header().channels().begin(); c != file.header().channels().end(); ++c) {
    channels += std::string(c.name()) + (c.channel().type == Imf::HALF ? ":half " : ":float ");
  }
  CHECK(channels ==
        "B:half G:half R:half bent.X:float bent.Y:float bent.Z:float occlusion.V:float ");
  CHECK(file.header().compression() == Imf::ZIP_COMPRESSION);
  std::vector<float> z(8);
  Imf::FrameBuffer buffer;
  buffer.insert("bent.Z", Imf::Slice::Make(Imf::FLOAT, z.data(), file.header().dataWindow()));
  file.setFrameBuffer(buffer);
  file.readPixels(0, 1);
  for (std::size_t i = 0; i < 8; ++i) CHECK(z[i] == ramp(24)[3 * i + 2]);
}

TEST_CASE("exr: channels without a layer, and text in the header", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  using Kind = ExrLayerType::Kind;
  const std::vector<ExrLayerType> layers{
      {"", Kind::colour, false}, {"A", Kind::channel, false}, {"Z", Kind::channel, true}};
  ExrWriter writer(path, ImageWindow::whole(4, 2), layers, {{"ptcx/names", "{\"1\":\"a\"}"}});
  const std::vector<float> colour = ramp(24), scalar = ramp(8);
  writer.write(2, std::array<std::span<const float>, 3>{colour, scalar, scalar});
  writer.publish();
  Imf::InputFile file(path.c_str());
  std::string channels;
  for (auto c = file.header().channels().begin(); c != file.header().channels().end(); ++c)
    channels += std::string(c.name()) + (c.channel().type == Imf::HALF ? ":half " : ":float ");
  CHECK(channels == "A:half B:half G:half R:half Z:float ");
  const auto* text = file.header().findTypedAttribute<Imf::StringAttribute>("ptcx/names");
  REQUIRE(text != nullptr);
  CHECK(text->value() == "{\"1\":\"a\"}");
  std::vector<float> z(8);
  Imf::FrameBuffer buffer;
  buffer.insert("Z", Imf::Slice::Make(Imf::FLOAT, z.data(), file.header().dataWindow()));
  file.setFrameBuffer(buffer);
  file.readPixels(0, 1);
  CHECK(z == scalar);
}

TEST_CASE("exr: halves saturate instead of becoming infinite", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  write_exr(path, 1, 1, {{"", ExrLayer::Kind::colour, false, {1e9F, 65504, 65519}}});
  CHECK(read_image(path).at(0, 0) == glm::vec3(65504));
}

TEST_CASE("exr: layers that do not fit are refused and leave no file", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  const ExrLayer good{"", ExrLayer::Kind::colour, false, ramp(12)};
  CHECK_THROWS_AS(write_exr(path, 2, 1, {good}), std::invalid_argument);
  CHECK_THROWS_AS(write_exr(path, 2, 2, {good, good}), std::invalid_argument);
  CHECK_THROWS_AS(write_exr(path, 0, 2, {}), std::invalid_argument);
  CHECK_THROWS_AS(write_exr(path, 2, 2, {}), std::invalid_argument);
  CHECK_THROWS_AS(write_exr(scratch.path() / "none" / "a.exr", 2, 2, {good}), std::system_error);
  CHECK(scratch.listing().empty());
}

TEST_CASE("exr: rows that come a few at a time make the file that all at once make", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const std::vector<float> colour = ramp(7 * 45 * 3), scalar = ramp(7 * 45);
  const std::vector<ExrLayerType> layers{{"", ExrLayerType::Kind::colour, false},
                                         {"depth", ExrLayerType::Kind::scalar, true}};
  write_exr(scratch.path() / "whole.exr", 7, 45, {{layers[0], colour}, {layers[1], scalar}});
  ExrWriter writer(scratch.path() / "parts.exr", ImageWindow::whole(7, 45), layers);
  const auto write = [&](unsigned first, unsigned rows) {
    const std::array<std::span<const float>, 2> values{
        std::span(colour).subspan(std::size_t{first} * 21, std::size_t{rows} * 21),
        std::span(scalar).subspan(std::size_t{first} * 7, std::size_t{rows} * 7)};
    writer.write(rows, values);
  };
  write(0, 1);
  write(1, 0);
  write(1, 30);
  CHECK_THROWS_AS(writer.publish(), std::invalid_argument);
  const std::array<std::span<const float>, 2> too_few{std::span(colour).first(21),
                                                      std::span(scalar).first(6)};
  CHECK_THROWS_AS(writer.write(1, too_few), std::invalid_argument);
  write(31, 14);
  CHECK_THROWS_AS(write(44, 1), std::invalid_argument);
  CHECK(!std::filesystem::exists(scratch.path() / "parts.exr"));
  writer.publish();
  CHECK(scratch.listing() == "parts.exr whole.exr");
  CHECK(slurp(scratch.path() / "parts.exr") == slurp(scratch.path() / "whole.exr"));
}

TEST_CASE("exr: every compression, type and tiling of the library is read", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  for (const Imf::Compression compression :
       {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
        Imf::PIZ_COMPRESSION, Imf::PXR24_COMPRESSION}) {
    for (const Imf::PixelType type : {Imf::FLOAT, Imf::HALF, Imf::UINT}) {
      for (const unsigned tile : {0U, 4U, 16U}) {
        write_with_library(path, {"RGB", compression, type, {{-2, 3}, {4, 12}}, tile});
        check_picture(read_image(path), {0, 100, 200});
      }
    }
  }
}

TEST_CASE("exr: pictures with more rows than one block are read whole", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  for (const unsigned tile : {0U, 100U}) {
    write_with_library(path, {"R", Imf::PIZ_COMPRESSION, Imf::FLOAT, {{0, -5}, {2, 594}}, tile});
    const Image image = read_image(path);
    REQUIRE(image.height == 600);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      REQUIRE(image.pixels[i] == glm::vec3(static_cast<float>(i), 0, 0));
    }
  }
}

TEST_CASE("exr: Y alone is grey, a missing colour is 0, other channels are skipped", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  write_with_library(path, {"Y"});
  check_picture(read_image(path), {0, 0, 0});
  write_with_library(path, {"ABGRZ"});
  check_picture(read_image(path), {300, 200, 100});
  write_with_library(path, {"GA"});
  CHECK(read_image(path).at(1, 0) == glm::vec3(0, 1, 0));
  write_with_library(path, {"AZ"});
  CHECK_THROWS_WITH(static_cast<void>(read_image(path)),
                    path.string() + ": EXR: the picture has no channel R, G, B or Y");
}

TEST_CASE("exr: negative and non-finite values become 0", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  write_exr(path, 2, 1, {{"", ExrLayer::Kind::colour, true, {-1, NAN, 2, INFINITY, -INFINITY, 3}}});
  const Image image = read_image(path);
  CHECK(image.at(0, 0) == glm::vec3(0, 0, 2));
  CHECK(image.at(1, 0) == glm::vec3(0, 0, 3));
}

TEST_CASE("exr: every truncation is refused", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  for (const unsigned tile : {0U, 4U}) {
    write_with_library(path, {"RGB", Imf::ZIP_COMPRESSION, Imf::HALF, {{0, 0}, {6, 9}}, tile});
    const std::string whole = slurp(path);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const auto cut = scratch.file("cut.exr", whole.substr(0, size));
      CHECK_THROWS_AS(static_cast<void>(read_image(cut)), DataError);
    }
  }
}

TEST_CASE("exr: a flipped byte changes the picture or has it refused, no more", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  for (const unsigned tile : {0U, 4U}) {
    write_with_library(path, {"RGB", Imf::PIZ_COMPRESSION, Imf::HALF, {{0, 0}, {6, 9}}, tile});
    const std::string whole = slurp(path);
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const int flip : {1, 0x80}) {
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ flip);
        const auto at = scratch.file("damaged.exr", damaged);
        static_cast<void>(refusal([&] { static_cast<void>(read_image(at)); }));
      }
    }
  }
}

TEST_CASE("exr: a header that claims a huge picture is refused", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  write_with_library(path, {"RGB", Imf::ZIP_COMPRESSION, Imf::HALF, {{0, 0}, {6, 9}}});
  std::string bytes = slurp(path);
  const std::size_t window = bytes.find("dataWindow") + sizeof "dataWindow" + sizeof "box2i" + 4;
  for (const std::int32_t side : {65534, 65536, 1 << 20, 0x7ffffff0}) {
    bytes.replace(window, 16, raw(0) + raw(0) + raw(side) + raw(side));
    CHECK_THROWS_AS(static_cast<void>(read_image(scratch.file("b.exr", bytes))), DataError);
  }
}

TEST_CASE("exr: an attribute whose length does not match its type is refused", "[io][exr]") {
  const test::TemporaryDirectory scratch;
  const auto path = scratch.path() / "a.exr";
  write_with_library(path, {"RGB", Imf::ZIP_COMPRESSION, Imf::HALF, {{0, 0}, {6, 9}}});
  const std::string whole = slurp(path);
  for (const std::string type : {"v2f", "float", "box2i", "compression", "chlist"}) {
    std::string bytes = whole;
    const std::size_t at = bytes.find(std::string(1, '\0') + type + '\0') + type.size() + 2;
    const auto size = static_cast<std::uint8_t>(bytes[at]);
    bytes[at] = static_cast<char>(size + 4);
    bytes.insert(at + 4 + size, 4, '\0');
    CHECK_THROWS_AS(static_cast<void>(read_image(scratch.file("b.exr", bytes))), DataError);
  }
}
