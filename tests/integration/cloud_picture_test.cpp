// Pictures of clouds: seen by rays, and lit as coarsely as their samples lie apart.
#include <algorithm>
#include <array>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/io/image/image.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/render/overview.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/render_picture.h"
#include "engine/pipeline/render/tile_renderer.h"
#include "engine/shade/shader.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// A city of 30,000 points, lit by a build.
struct City {
  TemporaryDirectory dir;
  RenderRequest request;

  City() {
    BuildRequest build;
    build.city_points = 30'000;
    Progress silent;
    build_container(build, dir / "city.ptcx", silent);
    request.scene = dir / "city.ptcx";
    request.size = {{20, 12}};
  }

  [[nodiscard]] Image render(const RenderRequest& asked, LightingReport* report = nullptr) const {
    const PictureTarget target{dir / "picture.exr"};
    Progress silent;
    const LightingReport made = render_picture(asked, {&target, 1}, silent);
    if (report) *report = made;
    return read_image(dir / "picture.exr");
  }
};

/// Returns a camera that sees all of a scene.
Camera camera_of(const ContainerReader& scene, unsigned width, unsigned height) {
  Camera camera = overview(scene, {0, 1, 0}, {}, {});
  camera.width = width;
  camera.height = height;
  return camera;
}

}  // namespace

TEST_CASE("cloud picture: neither threads nor the cap change a pixel",
          "[integration][render][cloud]") {
  City city;
  city.request.size = {{96, 54}};
  city.request.run = {.memory_bytes = std::uint64_t{1} << 30, .threads = 1};
  const Image one = city.render(city.request);
  CHECK(std::ranges::count(one.pixels, one.pixels.front()) <
        static_cast<std::ptrdiff_t>(one.pixels.size() * 9 / 10));  // which is the sky
  city.request.run = {.memory_bytes = std::uint64_t{122} << 20, .threads = 3};
  const Image other = city.render(city.request);
  CHECK((other.pixels == one.pixels));
}

TEST_CASE("cloud picture: a view of parts sees what a view of the whole picture sees",
          "[integration][render][cloud]") {
  // From so close that holes reach as far as they may, and from afar
  const City city;
  const ContainerReader scene(city.request.scene);
  const ThreadPool executor(2);
  Progress silent;
  Camera camera = camera_of(scene, 401, 350);
  for (const double share : {1.0, 0.2}) {
    camera.position = camera.look_at + share * (camera.position - camera.look_at);
    SurfelViewOptions options{.side = 2, .lift = 0.15F};
    const auto whole = view_surfels(scene, camera, options, executor, silent);
    options.depth_bytes = depth_bytes_for(256, 100);
    const auto parts = view_surfels(scene, camera, options, executor, silent);
    std::size_t seen = 0, unlike = 0;
    const Tile tile{0, 0, 64, 50};
    for (unsigned y0 = 0; y0 < camera.height; y0 += tile.height) {
      for (unsigned x0 = 0; x0 < camera.width; x0 += tile.width) {
        const SampleRect rect =
            samples_of({x0, y0, std::min(camera.width - x0, tile.width), tile.height}, 2);
        parts->look_at(rect);
        for (unsigned y = rect.y0; y < rect.y1; ++y) {
          for (unsigned x = rect.x0; x < rect.x1; ++x) {
            const auto a = whole->at(x, y), b = parts->at(x, y);
            if (a) ++seen;
            if (a.has_value() != b.has_value() ||
                (a && (a->position != b->position || a->direct != b->direct)))
              ++unlike;
          }
        }
      }
    }
    INFO(share);
    CHECK(unlike == 0);
    CHECK(seen > 100'000);
  }
}

TEST_CASE("cloud picture: a picture whose depth buffer does not fit is the same, part by part",
          "[integration][render][cloud]") {
  City city;
  city.request.size = {{700, 300}};
  city.request.samples = 16;  // 80 MB of depth buffer
  city.request.gather = {.solid_angle = 0.06F, .parallax = 0.3F, .resolution = 16};
  city.request.run.memory_bytes = std::uint64_t{1} << 30;
  const Image whole = city.render(city.request);
  city.request.run.memory_bytes = std::uint64_t{192} << 20;
  CHECK((city.render(city.request).pixels == whole.pixels));
}

TEST_CASE("render: wide pictures have low tiles of as many pixels", "[render]") {
  for (const unsigned side : {1U, 2U, 3U, 4U, 8U}) {
    const Tile usual = TileRenderer::tile_of(960, side);
    CHECK(usual.width == 256 / std::min(side, 4U));
    CHECK(usual.height == usual.width);
    for (const unsigned width : {1U, 4096U, 20'000U, 65'536U}) {
      const Tile tile = TileRenderer::tile_of(width, side);
      CHECK(tile.pixels() <= usual.pixels());  // odd heights are rounded down
      CHECK(tile.pixels() > usual.pixels() * 9 / 10);
      CHECK(std::uint64_t{width} * tile.height <= 1U << 19);
    }
  }
}

TEST_CASE("cloud picture: far samples are gathered coarsely, unless the request says how",
          "[integration][render][cloud]") {
  City city;
  RenderRequest coarse = city.request;
  coarse.gather.solid_angle = 0.06F;
  coarse.gather.parallax = 0.3F;
  coarse.gather.resolution = 16;
  RenderRequest named = city.request;
  named.gather.solid_angle = 0.0101F;
  // From afar
  const Image usual = city.render(city.request);
  CHECK((city.render(coarse).pixels == usual.pixels));
  CHECK((city.render(named).pixels != usual.pixels));
  // From so close that samples share their surfels
  const ContainerReader scene(city.request.scene);
  Camera near = overview(scene, {0, 1, 0}, {}, {});
  near.position = near.look_at + 0.2 * (near.position - near.look_at);
  for (RenderRequest* request : {&city.request, &coarse}) request->camera = near;
  CHECK((city.render(coarse).pixels != city.render(city.request).pixels));
}

TEST_CASE("cloud picture: variants by turns shade what each shades alone",
          "[integration][render][cloud]") {
  const City city;
  const ContainerReader scene(city.request.scene);
  const ThreadPool executor(2);
  Progress silent;
  const Camera camera = camera_of(scene, 240, 135);
  const auto view = view_surfels(scene, camera, {.lift = 0.15F}, executor, silent);
  std::vector<Receiver> receivers;
  for (unsigned y = 0; y < camera.height; ++y) {
    for (unsigned x = 0; x < camera.width; ++x) {
      if (const auto hit = view->at(x, y)) {
        receivers.push_back(
            {hit->position + glm::dvec3(hit->offset_normal * hit->lift), hit->normal});
      }
    }
  }
  REQUIRE(receivers.size() > Shader::kBlock + 100);
  const std::size_t first = Shader::kBlock + 50;  // of variant 0
  const std::array<std::size_t, 3> counts{first, 0, receivers.size() - first};
  std::vector<Shading> together(receivers.size()), alone(receivers.size());
  Shader shader(scene, {.cache_bytes = 64U << 20, .variants = 3}, executor);
  shader.shade_variants(receivers, together, silent, counts);
  const auto all = std::span(receivers);
  const auto results = std::span(alone);
  shader.shade(all.first(first), results.first(first), silent, 0);
  shader.shade(all.subspan(first), results.subspan(first), silent, 2);
  for (std::size_t i = 0; i < alone.size(); ++i) {
    REQUIRE(together[i].occlusion == alone[i].occlusion);
    REQUIRE(together[i].irradiance == alone[i].irradiance);
  }
}
