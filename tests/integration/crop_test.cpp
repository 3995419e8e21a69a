// Pictures of which a part is rendered.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/render/render_picture.h"
#include "tests/support/notes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

// The red of a layer in the whole of a picture of 60 x 40; -1 where the file does not hold it.
std::vector<float> red_of(const std::filesystem::path& path, const std::string& layer,
                          std::array<int, 4>& window) {
  Imf::InputFile file(path.c_str());
  const Imath::Box2i data = file.header().dataWindow(), shown = file.header().displayWindow();
  CHECK(shown == Imath::Box2i({0, 0}, {59, 39}));
  window = {data.min.x, data.min.y, data.max.x + 1, data.max.y + 1};
  std::vector<float> values(60 * 40, -1);
  Imf::FrameBuffer frame;
  frame.insert(layer, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float),
                                 60 * sizeof(float)));
  file.setFrameBuffer(frame);
  file.readPixels(data.min.y, data.max.y);
  return values;
}

}  // namespace

TEST_CASE("crop: a part of a picture is what the whole shows there", "[integration][crop]") {
  const test::TemporaryDirectory dir;
  test::Notes notes;
  dir.file("a.obj",
           "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n"
           "v 0 0.5 0\nv 1 0.5 0\nv 1 0.5 1\nv 0 0.5 1\nf 8 7 6 5\n");
  BuildRequest build{.inputs = {dir.path() / "a.obj"}};
  build.sampling.count = 3000;
  build_container(build, dir.path() / "a.ptcx", notes);
  RenderRequest request{{.scene = dir.path() / "a.ptcx"}};
  request.camera = Camera{.position = {1, 1.5, 2}, .look_at = {0, 0.1, 0}};
  request.size = {{60, 40}};
  const bool sees_mesh = GENERATE(true, false);
  if (sees_mesh) request.meshes = {dir.path() / "a.obj"};
  SECTION("in one") {}
  SECTION("in groups of lights") {
    request.lights = LightRig{};
    request.lights->suns = {{.group = "key"}};
    request.light_groups = true;
  }
  const auto render = [&](const std::string& name) {
    return render_picture(
        request,
        std::vector<PictureTarget>{{dir.path() / (name + ".exr")}, {dir.path() / (name + ".png")}},
        notes);
  };
  request.exposure = 0;
  const LightingReport whole = render("whole");
  request.crop = {{10, 7, 43, 30}};
  const LightingReport part = render("part");
  CHECK(part.receivers < whole.receivers);

  const Image png = read_image(dir.path() / "part.png");
  CHECK(png.width == 33);
  CHECK(png.height == 23);
  for (const auto& [layer, bound] :
       {std::pair("direct.R", 0.002), std::pair("albedo.R", 0.0), std::pair("R", 0.02)}) {
    std::array<int, 4> window{};
    const std::vector<float> all = red_of(dir.path() / "whole.exr", layer, window);
    CHECK(window == std::array{0, 0, 60, 40});
    const std::vector<float> some = red_of(dir.path() / "part.exr", layer, window);
    CHECK(window == std::array{10, 7, 43, 30});
    double sum = 0, most = 0;
    for (int y = 7; y < 30; ++y) {
      for (int x = 10; x < 43; ++x) {
        const auto at = static_cast<std::size_t>(60 * y + x);
        sum += static_cast<double>(all[at]);
        most = std::max(most, static_cast<double>(std::abs(all[at] - some[at])));
      }
    }
    INFO(layer);
    // Which receivers share a cell depends on what is rendered
    CHECK(most <= bound * sum / (23 * 33));
    CHECK(sum > 0);
    CHECK(some[60 * 6 + 20] == -1);
  }
}

TEST_CASE("crop: what is empty or leaves the picture is refused", "[integration][crop]") {
  const test::TemporaryDirectory dir;
  test::Notes notes;
  dir.file("a.obj", "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nf 3 2 1\n");
  RenderRequest request{{.scene = dir.path() / "a.obj"}};
  request.sampling.count = 500;
  request.size = {{60, 40}};
  const auto render = [&] {
    render_picture(request, std::vector<PictureTarget>{{dir.path() / "a.png"}}, notes);
  };
  for (const std::array<unsigned, 4> crop :
       {std::array{0U, 0U, 61U, 40U}, {0, 0, 60, 41}, {5, 5, 5, 9}, {5, 9, 6, 9}, {7, 0, 6, 9}}) {
    request.crop = crop;
    CHECK_THROWS_WITH(render(), Contains("leaves the picture of 60 x 40 pixels"));
  }
  request.texture = TextureTarget{};
  CHECK_THROWS_WITH(render(), Contains("what is baked is baked whole"));
  CHECK_FALSE(std::filesystem::exists(dir.path() / "a.png"));
}
