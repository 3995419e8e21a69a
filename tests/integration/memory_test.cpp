// The parts of a run that a memory cap must hold.
#include <array>
#include <functional>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/pipeline/budgets.h"
#include "engine/ptc.h"
#include "engine/store/reader.h"
#include "format/point_page.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Returns the minimum number of bytes with which a run is not refused.
std::uint64_t min_cap(const std::function<void(std::uint64_t)>& run) {
  const auto refused = [&](std::uint64_t bytes) {
    try {
      run(bytes);
      return false;
    } catch (const LimitError&) {
      return true;
    }
  };
  std::uint64_t below = 0, enough = std::uint64_t{256} << 20;
  while (enough - below > 1) {
    const std::uint64_t middle = below + (enough - below) / 2;
    (refused(middle) ? below : enough) = middle;
  }
  return enough;
}

/// Ends a build when the partition of its points, or their sampling, begins.
class EndAtPartition final : public Progress {
 public:
  struct Begun {};
  void begin(const std::string& stage, std::uint64_t /*total*/,
             const std::string& /*unit*/) override {
    if (stage == "partition" || stage == "sample and light") throw Begun();
  }
};

/// Builds until the cap is checked and the points are to be sorted.
void begin_build(const BuildRequest& request, const std::filesystem::path& target) {
  EndAtPartition until_begun;
  try {
    build_container(request, target, until_begun);
  } catch (const EndAtPartition::Begun&) {
  } catch (const std::system_error& error) {  // more temporary space than this disk has
    CHECK(error.code() == std::errc::no_space_on_device);
  }
}

}  // namespace

TEST_CASE(
    "memory: the cap of a build covers an encoder for each thread, pages that wait, and the "
    "directory after the sort",
    "[integration][memory]") {
  const TemporaryDirectory dir;
  const auto building = [&](std::uint64_t points, std::uint8_t page_shift, unsigned threads) {
    return min_cap([&](std::uint64_t bytes) {
      BuildRequest request;
      request.city_points = points;
      request.page_shift = page_shift;
      request.run = {.memory_bytes = bytes, .threads = threads};
      begin_build(request, dir / "o.ptcx");
    });
  };
  const std::uint64_t least = building(100, 12, 1);
  const std::uint64_t encoders = 9 * ((768 << 10) + (2 << 16)) - ((768 << 10) + (2 << 12));
  const std::uint64_t pages_of_4k = (256 + 64) << 12, pages_of_64k = (256 + 64) << 16;
  CHECK(building(100, 16, 9) - least == encoders + pages_of_64k - pages_of_4k);
  CHECK(building(100'000, 12, 1) == least);
  // Their directories take more than the minimum that the sort is given before.
  const std::uint64_t per_page = points_per_page({.page_shift = 12}), some = 60'000'000,
                      more = 120'000'000;
  const auto directory = [&](std::uint64_t points) { return 96 * (points / per_page * 8 / 5); };
  CHECK(building(more, 12, 1) - building(some, 12, 1) == directory(more) - directory(some));
  CHECK(building(some, 12, 1) - least == directory(some) - kMinSortBytes);
}

TEST_CASE("memory: the cap of a build covers an adapted spacing, however many surfels it makes",
          "[integration][memory]") {
  const TemporaryDirectory dir;
  Mesh square;
  square.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  square.triangles = {{0, 1, 2}, {0, 2, 3}};
  square.materials = {{.name = "white"}};
  square.material_of = {0, 0};
  BuildRequest request{.mesh = std::make_shared<const Mesh>(square)};
  const auto least = [&](double spacing, bool adapts) {
    return static_cast<double>(min_cap([&](std::uint64_t bytes) {
      request.sampling.spacing = spacing;
      request.sampling.adapts = adapts;
      request.run = {.memory_bytes = bytes, .threads = 1};
      begin_build(request, dir / "o.ptcx");
    }));
  };
  constexpr double kSome = 1e6, kMore = 4e6;  // surfels
  const double even = least(1e-3, false), adapted = least(1e-3, true), finer = least(5e-4, true);
  CHECK(adapted - even == Approx(32 * kSome).margin(1000));
  CHECK(finer - adapted == Approx((32 + 0.024) * (kMore - kSome)).margin(1000));
}

TEST_CASE("memory: the cap of a build covers the directory of points that emit light",
          "[integration][memory]") {
  const TemporaryDirectory dir;
  const auto building = [&](std::uint64_t points, const glm::vec3& emission) {
    Mesh mesh;
    mesh.materials = {{.name = "lamp", .emission = emission}};
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    mesh.material_of = {0};
    return min_cap([&](std::uint64_t bytes) {
      BuildRequest request{.mesh = std::make_shared<const Mesh>(mesh)};
      request.lights = LightRig{};
      request.sampling.count = points;
      request.page_shift = 12;
      request.run = {.memory_bytes = bytes, .threads = 1};
      begin_build(request, dir / "o.ptcx");
    });
  };
  const std::uint64_t points = 60'000'000;
  const auto pages = [&](std::uint8_t point_bytes) {
    return points / points_per_page({.page_shift = 12, .point_bytes = point_bytes}) * 8 / 5;
  };
  CHECK(building(points, glm::vec3(1)) - building(points, glm::vec3(0)) ==
        96 * (pages(kEmittingPointBytes) - pages(kPointBytes)));
}

TEST_CASE("memory: the cap for shading covers the directory of every open container",
          "[integration][memory]") {
  const TemporaryDirectory dir;
  write_scene(dir / "few.ptcx", random_surfels(100, 1));
  write_scene(dir / "many.ptcx", random_surfels(9000, 1));
  const std::uint64_t few = ContainerReader(dir / "few.ptcx").page_count();
  const std::uint64_t many = ContainerReader(dir / "many.ptcx").page_count();
  REQUIRE(many > few + 100);
  Progress silent;
  const auto shading = [&](const char* scene, const char* receivers) {
    return min_cap([&](std::uint64_t bytes) {
      ShadeRequest request{{.scene = dir / scene, .run = {.memory_bytes = bytes, .threads = 1}}};
      request.count = 1;
      if (*receivers != 0) request.receivers = dir / receivers;
      shade_container(request, dir / "o.ply", silent);
    });
  };
  // What is too small for the directory is refused before that is read
  ShadeRequest small{{.scene = dir / "many.ptcx", .run = {.memory_bytes = 100 * many}}};
  CHECK_THROWS_WITH(shade_container(small, dir / "o.ply", silent),
                    Catch::Contains("this scene") && Catch::Contains("directory of many.ptcx"));
  const std::uint64_t least = shading("few.ptcx", "");
  CHECK(shading("many.ptcx", "") == least + 40 * (many - few));
  CHECK(shading("few.ptcx", "few.ptcx") == least + 40 * few);
  CHECK(shading("few.ptcx", "many.ptcx") == least + 40 * many);
  const auto lit = [&](const char* scene, unsigned bounces, unsigned threads) {
    return min_cap([&](std::uint64_t bytes) {
      ShadeRequest request{
          {.scene = dir / scene, .run = {.memory_bytes = bytes, .threads = threads}}};
      request.bounces = bounces;
      shade_container(request, dir / "o.ptcx", silent);
    });
  };
  CHECK(lit("many.ptcx", 1, 1) - lit("few.ptcx", 1, 1) ==
        (40 + 2 * 96) * (many - few));  // with the directory of the output
  CHECK(lit("few.ptcx", 2, 1) - lit("few.ptcx", 1, 1) >
        (512 << 10) + (40 + 96) * few);  // with an encoder, too
  const auto picture = [&](const char* scene) {
    return min_cap([&](std::uint64_t bytes) {
      RenderRequest request{{.scene = dir / scene, .run = {.memory_bytes = bytes, .threads = 1}}};
      request.camera = Camera{.width = 2, .height = 2};
      render_picture(request, std::array{PictureTarget{dir / "o.png"}}, silent);
    });
  };
  CHECK(picture("many.ptcx") == picture("few.ptcx") + 40 * (many - few));
}
