// Textures in memory and in tiles on the disk.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/image/byte_range.h"
#include "engine/io/image/srgb.h"
#include "engine/io/image/texture.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

// A picture in which every pixel differs from those around it, in steps that 8 bits hold.
Image steps(unsigned width, unsigned height) {
  Image image{width, height, {}};
  for (unsigned y = 0; y < height; ++y) {
    for (unsigned x = 0; x < width; ++x) {
      image.pixels.emplace_back(static_cast<float>(x % 16) / 16, static_cast<float>(y % 16) / 16,
                                static_cast<float>((x / 16 + y / 16) % 16) / 16);
    }
  }
  return image;
}

std::size_t files_in(const std::filesystem::path& directory) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator(directory), {}));
}

}  // namespace

TEST_CASE("texture store: tiles on the disk hold the pixels that memory would, in every type",
          "[io][texture]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "filler.png", steps(1000, 100));
  for (const auto& [width, height] :
       {std::pair{1U, 1U}, {31U, 43U}, {32U, 42U}, {33U, 5U}, {257U, 130U}, {5U, 300U}}) {
    const Image image = steps(width, height);
    write_png(scratch.path() / "a.png", image);
    std::vector<float> values;
    for (const glm::vec3& pixel : image.pixels) values.insert(values.end(), &pixel.x, &pixel.x + 3);
    for (const bool full : {false, true}) {
      write_exr(scratch.path() / (full ? "full.exr" : "half.exr"), width, height,
                {{{.name = "", .full_float = full}, values}});
    }
    for (const char* name : {"a.png", "half.exr", "full.exr"}) {
      const Image expected = read_image(scratch.path() / name);
      const Texture held = TextureStore::make()->read(scratch.path() / name);
      // Fill what textures may take in memory
      const auto store = TextureStore::make(600'000, scratch.path());
      CHECK(store->read(scratch.path() / "filler.png").bytes() == 300'000);
      const Texture tiled = store->read(scratch.path() / name);
      CHECK(held.store() == nullptr);
      CHECK(held.bytes() > 0);
      CHECK(tiled.store() == store.get());
      CHECK(tiled.bytes() == 0);
      CHECK(store->cache_bytes() > 0);
      for (unsigned y = 0; y < height; ++y) {
        for (unsigned x = 0; x < width; ++x) {
          REQUIRE(held.at(x, y) == expected.at(x, y));
          REQUIRE(tiled.at(x, y) == expected.at(x, y));
        }
      }
      std::vector<glm::vec3> rows;
      tiled.visit_rows(
          [&](std::span<const glm::vec3> row) { rows.insert(rows.end(), row.begin(), row.end()); });
      CHECK(rows == expected.pixels);
    }
  }
  CHECK(files_in(scratch.path()) == 4);  // the temporary files are gone
}

TEST_CASE("texture store: textures stay in memory as long as all of them take half of the cap",
          "[io][texture]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", steps(100, 100));  // 30,000 bytes
  const auto store = TextureStore::make(120'000, scratch.path());
  const Texture first = store->read(scratch.path() / "a.png");
  const Texture second = store->read(scratch.path() / "a.png");
  CHECK(store->cache_bytes() == 0);
  const Texture third = store->read(scratch.path() / "a.png");
  CHECK(first.bytes() + second.bytes() == 60'000);
  CHECK(third.bytes() == 0);
  CHECK(store->cache_bytes() > 0);
  CHECK(store->cache_bytes() <= 30'000);
  CHECK(third.at(99, 99) == first.at(99, 99));
}

TEST_CASE("texture store: threads that look up the same tiles see the same pixels",
          "[io][texture]") {
  const test::TemporaryDirectory scratch;
  const Image image = steps(200, 200);
  write_png(scratch.path() / "a.png", image);
  const Image expected = read_image(scratch.path() / "a.png");
  const auto store = TextureStore::make(20'000, scratch.path());
  const Texture texture = store->read(scratch.path() / "a.png");
  REQUIRE(texture.store() != nullptr);
  std::vector<std::size_t> wrong(4);
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      unsigned at = t;
      for (int i = 0; i < 20'000; ++i) {
        at = at * 1664525 + 1013904223;
        const unsigned x = (at >> 8) % 200, y = (at >> 16) % 200;
        if (texture.at(x, y) != expected.at(x, y)) ++wrong[t];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(wrong == std::vector<std::size_t>(4));
}

TEST_CASE("texture store: what cannot be decoded row by row is refused by its size",
          "[io][texture]") {
  // A BMP of 200 x 200 pixels
  const test::TemporaryDirectory scratch;
  const std::string bmp = "BM" + raw<std::uint32_t>(120'054) + raw<std::uint32_t>(0) +
                          raw<std::uint32_t>(54) + raw<std::uint32_t>(40) + raw<std::int32_t>(200) +
                          raw<std::int32_t>(200) + raw<std::uint16_t>(1) + raw<std::uint16_t>(24) +
                          std::string(24, '\0') + std::string(120'000, '\x40');
  const auto path = scratch.file("a.bmp", bmp);
  CHECK(TextureStore::make(500'000, scratch.path())->read(path).width() == 200);
  // A texture that the cap refuses is no texture that is missing
  scratch.file("a.mtl", "newmtl a\nmap_Kd a.bmp\n");
  const auto obj =
      scratch.file("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
  CHECK_THROWS_AS(read_mesh(obj, {.textures = TextureStore::make(100'000, scratch.path())}),
                  LimitError);
  const auto poor = TextureStore::make(100'000, scratch.path());
  CHECK_THROWS_AS(poor->read(path), LimitError);
  CHECK_THROWS_WITH(poor->read(path),
                    Contains("a.bmp: a BMP or TGA takes ") && Contains("`run.memory_bytes`"));
}

TEST_CASE("texture store: opacity is alpha, or grey where a picture has none", "[io][texture]") {
  const test::TemporaryDirectory scratch;
  const auto read = [&](const std::shared_ptr<TextureStore>& store, const char* name, bool grey) {
    const InputFile file(scratch.path() / name);
    return store->read_opacity(ByteRange(file, 0, file.size()), name, grey);
  };
  std::vector<std::uint8_t> alpha;
  for (unsigned i = 0; i < 300; ++i) alpha.push_back(static_cast<std::uint8_t>(i * 7));
  scratch.file("a.tga", tga_with_alpha(alpha));
  scratch.file("opaque.tga", tga_with_alpha(std::vector<std::uint8_t>(300, 255)));
  const Image grey = steps(300, 5);
  write_png(scratch.path() / "grey.png", grey);
  write_png(scratch.path() / "white.png", {1, 1, {glm::vec3(1)}});
  write_png(scratch.path() / "filler.png", steps(1000, 100));
  write_exr(scratch.path() / "b.exr", 2, 1, {{{.name = ""}, {0.25F, 0.5F, 0.75F, 2, 3, 4}}});
  for (const bool on_disk : {false, true}) {
    const auto store = on_disk ? TextureStore::make(600'000, scratch.path()) : TextureStore::make();
    if (on_disk) CHECK(store->read(scratch.path() / "filler.png").bytes() == 300'000);
    const std::uint64_t before = store->bytes();
    const auto found = read(store, "a.tga", true);
    REQUIRE(found);
    CHECK((found->store() != nullptr) == on_disk);
    for (unsigned x = 0; x < 300; ++x)
      REQUIRE(found->at(x, 0) == glm::vec3(static_cast<float>(alpha[x]) / 255));
    CHECK_FALSE(read(store, "opaque.tga", false));
    CHECK_FALSE(read(store, "grey.png", false));
    CHECK_FALSE(read(store, "white.png", true));
    CHECK_FALSE(read(store, "b.exr", false));
    if (!on_disk) CHECK(store->bytes() == before + 300);
    // The mean of what is stored, without a curve
    const auto of_grey = read(store, "grey.png", true);
    REQUIRE(of_grey);
    for (unsigned x = 0; x < 300; ++x) {
      const glm::vec3& p = grey.at(x, 2);
      const auto stored = [](float c) { return std::round(255 * linear_to_srgb(double{c})); };
      const double mean = (stored(p.x) + stored(p.y) + stored(p.z)) / 3;
      REQUIRE(of_grey->at(x, 2).x * 255 == Approx(mean).margin(0.51));
    }
    const auto of_exr = read(store, "b.exr", true);
    REQUIRE(of_exr);
    CHECK(of_exr->at(0, 0).x == Approx(0.5).margin(0.002));
    CHECK(of_exr->at(1, 0).x == 1);
  }
}
