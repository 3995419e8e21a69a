// The whole pipeline: mesh or cloud to container to shaded points and pictures.
#include <fstream>
#include <limits>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/scene_record.h"
#include "engine/ptc.h"
#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "tests/shade/gather_scene.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Returns the checksums of all pages except the one with the record, which names the inputs.
std::vector<std::uint64_t> pages_of(const std::filesystem::path& path) {
  const ContainerReader container(path);
  std::vector<std::uint64_t> pages;
  for (std::uint32_t page = 0; page < container.page_count(); ++page) {
    if (page != container.meta_page()) pages.push_back(container.entry(page).payload_xxh3);
  }
  return pages;
}

/// A unit cube as OBJ, whose faces front the outside.
void write_cube(const std::filesystem::path& path) {
  std::ofstream(path) << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
                         "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 1 5 8 4\nf 2 3 7 6\n";
}

BuildRequest cube_request(const std::filesystem::path& mesh) {
  BuildRequest request;
  request.inputs = {mesh};
  request.backdrop = true;
  request.sampling.count = 6'000;
  request.sampling.lights.sky_rays = 4;
  request.lights = LightRig{.suns = {{}}, .sky = {.radiance = glm::vec3(0.5F)}};
  request.run.memory_bytes = std::uint64_t{256} << 20;
  request.run.threads = 1;
  return request;
}

}  // namespace

TEST_CASE("pipeline: neither threads nor the cap change any byte of a container",
          "[integration][build]") {
  const TemporaryDirectory dir;
  write_cube(dir / "cube.obj");
  Progress silent;
  BuildRequest request = cube_request(dir / "cube.obj");
  build_container(request, dir / "one.ptcx", silent);
  request.run.threads = 2;
  request.run.memory_bytes = std::uint64_t{148} << 20;
  build_container(request, dir / "two.ptcx", silent);
  CHECK(bytes_of(dir / "one.ptcx") == bytes_of(dir / "two.ptcx"));
  request.sampling.lights.sky_rays = 5;
  build_container(request, dir / "other.ptcx", silent);
  CHECK(bytes_of(dir / "one.ptcx") != bytes_of(dir / "other.ptcx"));
}

TEST_CASE("pipeline: meshes without any light get the default sun and sky, clouds a white sky",
          "[integration][build]") {
  const TemporaryDirectory dir;
  const auto lights_of = [&](const std::filesystem::path& input,
                             const std::optional<LightRig>& lights) {
    Progress silent;
    BuildRequest request = cube_request(input);
    request.lights = lights;
    build_container(request, dir / "a.ptcx", silent);
    return ContainerReader(dir / "a.ptcx").meta().text.at(kLightsKey);
  };
  write_cube(dir / "cube.obj");
  CHECK(lights_of(dir / "cube.obj", {}) == to_json(default_rig()));
  CHECK(lights_of(dir / "cube.obj", LightRig{}) == to_json(LightRig{}));
  std::ofstream(dir / "lamp.mtl") << "newmtl lamp\nKe 1 1 1\n";
  std::ofstream(dir / "lamp.obj")
      << "mtllib lamp.mtl\nusemtl lamp\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  CHECK(lights_of(dir / "lamp.obj", {}) == to_json(LightRig{}));
  std::ofstream(dir / "cloud.xyz") << "0 0 0 0 1 0\n1 0 0 0 1 0\n";
  CHECK(lights_of(dir / "cloud.xyz", {}) == to_json(cloud_rig({0, 1, 0})));
  std::ofstream(dir / "lit.xyz") << "0 0 0 0 1 0 1 1 1 1\n1 0 0 0 1 0 1 1 1 1\n";
  CHECK(lights_of(dir / "lit.xyz", {}) == to_json(LightRig{}));
}

TEST_CASE("pipeline: a mesh in memory gives the same container as its file",
          "[integration][build]") {
  const TemporaryDirectory dir;
  write_cube(dir / "cube.obj");
  std::ofstream(dir / "tile.obj") << "v 2 0 0\nv 2 0 1\nv 3 0 0\nf 1 2 3\n";
  Progress silent;
  BuildRequest from_files = cube_request(dir / "cube.obj");
  BuildRequest from_memory = from_files;
  from_memory.inputs.clear();
  from_memory.mesh = std::make_shared<const Mesh>(read_mesh(dir / "cube.obj").mesh);
  for (const bool backdrop : {false, true}) {
    from_files.backdrop = from_memory.backdrop = backdrop;
    const BuildReport file = build_container(from_files, dir / "file.ptcx", silent);
    const BuildReport memory = build_container(from_memory, dir / "memory.ptcx", silent);
    CHECK(memory.superblock.points == file.superblock.points);
    CHECK(pages_of(dir / "memory.ptcx") == pages_of(dir / "file.ptcx"));
  }

  from_files.inputs.push_back(dir / "tile.obj");
  from_memory.inputs = {dir / "cube.obj"};
  from_memory.mesh = std::make_shared<const Mesh>(read_mesh(dir / "tile.obj").mesh);
  build_container(from_files, dir / "file.ptcx", silent);
  build_container(from_memory, dir / "memory.ptcx", silent);
  CHECK(pages_of(dir / "memory.ptcx") == pages_of(dir / "file.ptcx"));

  Mesh broken = *from_memory.mesh;
  broken.triangles[0][2] = 3;
  from_memory.inputs.clear();
  from_memory.mesh = std::make_shared<const Mesh>(broken);
  CHECK_THROWS_AS(build_container(from_memory, dir / "broken.ptcx", silent), RequestError);
  CHECK_FALSE(std::filesystem::exists(dir / "broken.ptcx"));
}

TEST_CASE("pipeline: a double-sided solid gives the container of a one-sided one",
          "[integration][build]") {
  const TemporaryDirectory dir;
  write_cube(dir / "cube.obj");
  Progress silent;
  BuildRequest one = cube_request(dir / "cube.obj");
  one.backdrop = false;  // the ground would be a front that the cube touches
  BuildRequest both = one;
  one.one_sided = true;
  const bool room = GENERATE(false, true);  // a lamp in it makes it one, of two sides
  if (room) one.lights->points = both.lights->points = {{.position = {0.5, 0.5, 0.4}}};
  build_container(one, dir / "one.ptcx", silent);
  build_container(both, dir / "both.ptcx", silent);
  CHECK((pages_of(dir / "both.ptcx") == pages_of(dir / "one.ptcx")) == !room);
}

TEST_CASE("pipeline: an output that does not fit on its disk is refused before work begins",
          "[integration][build]") {
  const TemporaryDirectory dir;
  const std::vector<std::filesystem::path> temps{dir.path(), dir.path()};
  CHECK_THROWS_WITH(
      require_build_space(std::uint64_t{1} << 45, 0, Profile::raw, temps, dir / "a.ptcx"),
      Catch::Contains("take about 1618481.1 GB in " + dir.path().string()) &&
          Catch::Contains(" GB free"));
  const BuildSpace space = require_build_space(1000, 40'000, Profile::raw, temps, dir / "a.ptcx");
  CHECK(space.temp_bytes == 40'000);
  CHECK(space.output_bytes == 46'000);
  CHECK(space.temp_free_bytes < space.output_free_bytes * 3 / 2);  // twice the same disk
  CHECK(require_build_space(0, 0, Profile::raw, temps, dir / "a.ptcx").output_free_bytes ==
        0);  // not known
}

TEST_CASE("pipeline: a build through temporary files gives the bytes of a build in memory",
          "[integration][build]") {
  const TemporaryDirectory dir;
  Progress silent;
  BuildRequest request;
  request.city_points = 1'200'000;  // 48 MB of records
  request.run.threads = 2;
  request.run.memory_bytes = std::uint64_t{1} << 30;
  const BuildReport roomy = build_container(request, dir / "roomy.ptcx", silent);
  request.run.memory_bytes = std::uint64_t{104} << 20;
  const BuildReport tight = build_container(request, dir / "tight.ptcx", silent);
  CHECK(roomy.sort.spilled_bytes == 0);
  CHECK(tight.sort.spilled_bytes > 0);
  CHECK(bytes_of(dir / "roomy.ptcx") == bytes_of(dir / "tight.ptcx"));
  CHECK(verify_container(dir / "tight.ptcx", {}, silent).sound());
}

TEST_CASE("pipeline: shading adds channels, keeps the points and gives a valid container",
          "[integration][shade]") {
  const TemporaryDirectory dir;
  write_cube(dir / "cube.obj");
  Progress silent;
  build_container(cube_request(dir / "cube.obj"), dir / "scene.ptcx", silent);
  ShadeRequest request{{.scene = dir / "scene.ptcx"}};
  request.run = {.memory_bytes = std::uint64_t{128} << 20, .threads = 2};
  const std::vector<char> before = bytes_of(dir / "scene.ptcx");
  shade_container(request, dir / "shaded.ptcx", silent);
  CHECK(bytes_of(dir / "scene.ptcx") == before);
  CHECK(verify_container(dir / "shaded.ptcx", {}, silent).sound());
  const ContainerReader scene(dir / "scene.ptcx"), shaded(dir / "shaded.ptcx");
  CHECK(shaded.superblock().points == scene.superblock().points);
  REQUIRE(shaded.meta().channels.size() == 5);
  CHECK(shaded.meta().channels[0].name == "occlusion");

  // Shading a shaded container replaces the channels, which gives the same bytes again.
  request.scene = dir / "shaded.ptcx";
  shade_container(request, dir / "again.ptcx", silent);
  CHECK(ContainerReader(dir / "again.ptcx").superblock().content_xxh3 ==
        shaded.superblock().content_xxh3);

  shade_container(request, dir / "shaded.ply", silent);
  const PointFile ply = open_points(dir / "shaded.ply");
  CHECK(ply.info.count == scene.superblock().points);

  request.count = 37;
  CHECK(shade_container(request, dir / "some.ply", silent).receivers == 37);
  CHECK(open_points(dir / "some.ply").info.count == 37);
  CHECK_THROWS_WITH(shade_container(request, dir / "some.ptcx", silent), Catch::Contains(".ply"));
  CHECK_FALSE(std::filesystem::exists(dir / "some.ptcx"));
}

TEST_CASE("pipeline: a scene can shade the points of another cloud", "[integration][shade]") {
  const TemporaryDirectory dir;
  write_cube(dir / "cube.obj");
  Progress silent;
  build_container(cube_request(dir / "cube.obj"), dir / "scene.ptcx", silent);
  std::ofstream(dir / "probes.xyz") << "0.5 1.5 0.5 0 -1 0\n-0.02 0.5 0.5 -1 0 0\n";
  ShadeRequest request{{.scene = dir / "scene.ptcx"}};
  request.receivers = dir / "probes.xyz";
  const LightingReport report = shade_container(request, dir / "probes.ply", silent);
  CHECK(report.receivers == 2);
  std::size_t entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(dir.path()))
    ++entries;
  CHECK(entries == 4);  // cube, scene, probes.xyz, probes.ply: no temporary is left
}

TEST_CASE("pipeline: a picture has the layers it promises, with and without a mesh",
          "[integration][render]") {
  const TemporaryDirectory dir;
  write_cube(dir / "cube.obj");
  Progress silent;
  build_container(cube_request(dir / "cube.obj"), dir / "scene.ptcx", silent);
  RenderRequest request{{.scene = dir / "scene.ptcx"}};
  request.meshes = {dir / "cube.obj"};
  request.backdrop = true;
  request.samples = 1;
  request.size = {{64, 48}};
  request.camera = Camera{.position = {2, 1.5, 3.5}, .look_at = {0.5, 0.5, 0.5}};
  const std::vector<PictureTarget> targets{
      {dir / "a.exr"}, {dir / "a.png", "beauty"}, {dir / "o.png", "occlusion"}};
  render_picture(request, targets, silent);
  const Image with_mesh = read_image(dir / "a.exr");
  CHECK(with_mesh.width == 64);
  CHECK(with_mesh.height == 48);
  request.meshes.clear();
  const std::vector<PictureTarget> splatted{{dir / "b.exr"}};
  render_picture(request, splatted, silent);
  const Image with_surfels = read_image(dir / "b.exr");
  // The mesh and its surfels are seen from the same place: most pixels agree closely.
  std::size_t close = 0;
  for (std::size_t i = 0; i < with_mesh.pixels.size(); ++i) {
    close += std::abs(with_mesh.pixels[i].g - with_surfels.pixels[i].g) < 0.1F;
  }
  CHECK(close > with_mesh.pixels.size() * 80 / 100);
}

TEST_CASE("pipeline: a cap that is too small is refused with the minimum that works",
          "[integration]") {
  const TemporaryDirectory dir;
  Progress silent;
  BuildRequest request;
  request.city_points = 10'000;
  request.run = {.memory_bytes = std::uint64_t{60} << 20, .threads = 2};
  CHECK_THROWS_WITH(build_container(request, dir / "a.ptcx", silent),
                    Catch::Contains("least that works is 86M"));
  request.run.memory_bytes = std::uint64_t{86} << 20;
  CHECK_NOTHROW(build_container(request, dir / "a.ptcx", silent));
}

TEST_CASE("pipeline: inputs without points are refused", "[integration]") {
  const TemporaryDirectory dir;
  Progress silent;
  std::ofstream(dir / "none.ply")
      << "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
         "property float z\nend_header\n";
  BuildRequest request;
  request.inputs = {dir / "none.ply"};
  CHECK_THROWS_WITH(build_container(request, dir / "a.ptcx", silent), Catch::Contains("no points"));
  CHECK_FALSE(std::filesystem::exists(dir / "a.ptcx"));
}

TEST_CASE("pipeline: a request that is out of range is refused with the name of its field",
          "[integration][request]") {
  const TemporaryDirectory dir;
  const auto scene = dir / "scene.ptcx";
  write_scene(scene, small_scene(0.1), {}, 12, Codec::zstd);
  Progress silent;
  const auto field_of = [&](const auto& run) -> std::string {
    try {
      run();
    } catch (const RequestError& error) {
      CHECK_FALSE(std::string(error.what()).empty());
      return error.field();
    }
    return "none";
  };
  const auto build = [&](auto&& spoil) {
    BuildRequest request{.city_points = 1000};
    spoil(request);
    return field_of([&] { build_container(request, dir / "o.ptcx", silent); });
  };
  CHECK(build([](BuildRequest& r) { r.page_shift = 11; }) == "page_shift");
  CHECK(build([](BuildRequest& r) { r.page_shift = 21; }) == "page_shift");
  CHECK(build([](BuildRequest& r) { r.tree.leaf_points = 0; }) == "tree.leaf_points");
  CHECK(build([](BuildRequest& r) { r.tree.leaf_points = 65536; }) == "tree.leaf_points");
  CHECK(build([](BuildRequest& r) { r.tree.levels_per_stream = 0; }) == "tree.levels_per_stream");
  CHECK(build([](BuildRequest& r) { r.checkpoint_points = 0; }) == "checkpoint_points");
  CHECK(build([](BuildRequest& r) { r.run.memory_bytes = 1 << 20; }) == "run.memory_bytes");
  const auto dark = [](const glm::vec3& up) { return LightRig{.sky = {.up = up}}; };
  CHECK(build([&](BuildRequest& r) { r.lights = dark(glm::vec3(0)); }) == "lights");
  CHECK(build([](BuildRequest& r) { r.sampling.camera = Camera{.position = glm::dvec3(NAN)}; }) ==
        "sampling.camera");
  const auto shade = [&](auto&& spoil, const char* target = "o.ply") {
    ShadeRequest request{{.scene = scene}};
    spoil(request);
    return field_of([&] { shade_container(request, dir / target, silent); });
  };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  CHECK(shade([](ShadeRequest& r) { r.check = {.receivers = 10, .rays = 0}; }) == "check.rays");
  CHECK(shade([](ShadeRequest& r) { r.sky = Sky{.up = glm::vec3(0)}; }) == "sky");
  CHECK(shade([](ShadeRequest& r) { r.sky = Sky{.radiance = glm::vec3(-1)}; }) == "sky");
  CHECK(shade([](ShadeRequest& r) { r.gather.resolution = 20; }) == "gather.resolution");
  CHECK(shade([](ShadeRequest& r) { r.gather.resolution = 80; }) == "gather.resolution");
  CHECK(shade([](ShadeRequest& r) { r.gather.solid_angle = 0; }) == "gather.solid_angle");
  CHECK(shade([](ShadeRequest& r) { r.gather.parallax = kNan; }) == "gather.parallax");
  CHECK(shade([](ShadeRequest& r) { r.gather.inflation = -1; }) == "gather.inflation");
  CHECK(shade([](ShadeRequest& r) { r.error = 0; }) == "error");
  CHECK(shade([](ShadeRequest& r) { r.lift = kNan; }) == "lift");
  CHECK(shade([](ShadeRequest& r) { r.estimate = true; }) == "estimate");
  CHECK(shade([](ShadeRequest& r) { r.tolerate_damage = true, r.bounces = 2; }) ==
        "tolerate_damage");
  CHECK(shade([](ShadeRequest& r) { r.count = 5; }, "o.ptcx") == "count");
  CHECK(shade([](ShadeRequest&) {}, "o.cloud") == "target");
  const auto render = [&](auto&& spoil, std::vector<PictureTarget> targets) {
    RenderRequest request{{.scene = scene}};
    request.size = {8, 8};
    spoil(request);
    return field_of([&] { render_picture(request, targets, silent); });
  };
  CHECK(render([](RenderRequest& r) { r.samples = 3; }, {{dir / "o.png"}}) == "samples");
  CHECK(render([](RenderRequest& r) { r.samples = 0; }, {{dir / "o.png"}}) == "samples");
  CHECK(render([](RenderRequest& r) { r.size = {{0, 8}}; }, {{dir / "o.png"}}) == "size");
  CHECK(render([](RenderRequest& r) { r.size = {{65537, 1}}; }, {{dir / "o.png"}}) == "size");
  CHECK(render([](RenderRequest&) {}, {{dir / "o.jpg"}}) == "targets");
  CHECK(render([](RenderRequest&) {}, {}) == "targets");
  CHECK(render([](RenderRequest&) {}, {{dir / "o.png", "motion"}}) == "targets");
  CHECK(render([&](RenderRequest& r) { r.lights = dark(glm::vec3(0)); }, {{dir / "o.png"}}) ==
        "lights");
  CHECK(render([](RenderRequest& r) { r.camera = Camera{.position = glm::dvec3(NAN)}; },
               {{dir / "o.png"}}) == "camera");
  const auto recode = [&](std::uint8_t page_shift) {
    return field_of([&] {
      recode_container(ContainerReader(scene), dir / "o.ptcx", {.page_shift = page_shift}, silent);
    });
  };
  for (const int shift : {0, 5, 11, 21, 64, 255})
    CHECK(recode(static_cast<std::uint8_t>(shift)) == "page_shift");
  CHECK(std::filesystem::directory_iterator(dir.path())->path() == scene);
}

TEST_CASE("pipeline: meshes too far from each other are refused with the name of their field",
          "[integration][request]") {
  const TemporaryDirectory dir;
  write_scene(dir / "scene.ptcx", small_scene(0.1), {}, 12, Codec::zstd);
  std::ofstream(dir / "near.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  std::ofstream(dir / "far.obj") << "v 4e18 0 0\nv 5e18 0 0\nv 4e18 1e18 0\nf 1 2 3\n";
  Progress silent;
  const auto field_of = [](const auto& run) -> std::string {
    try {
      run();
    } catch (const RequestError& error) {
      return error.field();
    }
    return "none";
  };
  const BuildRequest build{.inputs = {dir / "near.obj", dir / "far.obj"}};
  CHECK(field_of([&] { build_container(build, dir / "o.ptcx", silent); }) == "inputs");
  RenderRequest render{{.scene = dir / "scene.ptcx"}};
  render.meshes = build.inputs;
  render.size = {8, 8};
  const std::vector<PictureTarget> target{{dir / "o.png"}};
  CHECK(field_of([&] { render_picture(render, target, silent); }) == "meshes");
}

TEST_CASE("pipeline: receivers are a container whatever the name of the file is",
          "[integration][shade]") {
  const TemporaryDirectory dir;
  write_scene(dir / "scene.ptcx", small_scene(0.1), {}, 12, Codec::zstd);
  std::filesystem::copy_file(dir / "scene.ptcx", dir / "scene.part");
  ShadeRequest request{{.scene = dir / "scene.ptcx"}};
  request.receivers = dir / "scene.part";
  Progress silent;
  CHECK(shade_container(request, dir / "o.ply", silent).receivers > 0);
}

namespace {

/// Collects the names of the stages of a run.
class Stages : public Progress {
 public:
  void begin(const std::string& stage, std::uint64_t /*total*/,
             const std::string& /*unit*/) override {
    names.push_back(stage);
  }
  std::vector<std::string> names;
};

/// A mesh of two triangles, and a rig whose record grows with the name of its sky picture.
struct LongRecord {
  LongRecord() {
    std::ofstream(dir / "mesh.obj") << "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 4 3 2 1\n";
  }

  /// Builds with pages of 4 KiB. @return the field that was refused; empty for a build
  std::string build(std::size_t name_bytes) {
    BuildRequest request{.inputs = {dir / "mesh.obj"}, .page_shift = 12};
    std::string picture(name_bytes, 'n');
    picture.front() = '/';
    request.lights = LightRig{.sky = {.map_path = picture}};
    request.sampling.count = 50;
    request.sampling.lights = {.sun_rays = 1, .area_rays = 0, .sky_rays = 1};
    stages.names.clear();
    try {
      build_container(request, target(), stages);
    } catch (const RequestError& error) {
      return error.field();
    }
    return {};
  }

  [[nodiscard]] std::filesystem::path target() const { return dir / "o.ptcx"; }

  TemporaryDirectory dir;
  Stages stages;
};

}  // namespace

TEST_CASE("pipeline: a record that may not fit a page with its spacing is refused before sampling",
          "[integration][request]") {
  LongRecord record;
  std::size_t refused = 0;
  for (std::size_t bytes = 3000; bytes < 4096; bytes += 8) {
    const std::string field = record.build(bytes);
    if (field.empty()) continue;
    CHECK(field == "page_shift");
    CHECK(record.stages.names == std::vector<std::string>{"read"});
    ++refused;
  }
  CHECK(refused > 8);
  CHECK(refused < 100);
}

TEST_CASE("pipeline: a record without room for shaded channels is refused before any light",
          "[integration][request]") {
  LongRecord record;
  std::size_t bytes = 3000;
  while (record.build(bytes + 8).empty()) bytes += 8;
  REQUIRE(record.build(bytes).empty());
  ShadeRequest request{{.scene = record.target(), .bounces = 2}};
  request.sky = Sky{};
  Stages stages;
  CHECK_THROWS_AS(shade_container(request, record.dir / "shaded.ptcx", stages), DataError);
  CHECK_THROWS_WITH(shade_container(request, record.dir / "shaded.ptcx", stages),
                    Catch::Contains("o.ptcx") && Catch::Contains("to larger pages"));
  CHECK(stages.names.empty());
  CHECK_NOTHROW(shade_container(request, record.dir / "shaded.ply", stages));
}
