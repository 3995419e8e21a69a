// Meshes larger than the memory cap, from the file to lit surfels and a picture.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/image/image.h"
#include "engine/ptc.h"
#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "tests/support/notes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Writes a square of 10 x 10 that waves up and down, 2 n^2 triangles, as a binary PLY.
void write_waves(const std::filesystem::path& path, int n) {
  std::ofstream out(path, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << (n + 1) * (n + 1)
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << 2 * n * n
      << "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto put = [&](const auto& value) {
    out.write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (int i = 0; i <= n; ++i) {
    for (int k = 0; k <= n; ++k) {
      const float x = 10 * static_cast<float>(i) / static_cast<float>(n),
                  z = 10 * static_cast<float>(k) / static_cast<float>(n);
      for (const float p : {x, 0.6F * std::sin(2 * x) * std::cos(1.5F * z), z}) put(p);
    }
  }
  for (int i = 0; i < n * n; ++i) {
    const int a = i / n * (n + 1) + i % n, b = a + n + 1;
    for (const auto& triangle : {std::array{a, a + 1, b + 1}, std::array{a, b + 1, b}}) {
      put(static_cast<unsigned char>(3));
      for (const int corner : triangle) put(corner);
    }
  }
}

bool tells(const Notes& notes, const char* text) {
  return std::ranges::any_of(
      notes.texts, [&](const std::string& note) { return note.find(text) != std::string::npos; });
}

/// The sum over all points of a container.
double flux_of(const std::filesystem::path& path) {
  const std::array<double, 3> flux = ContainerReader(path).superblock().flux;
  return flux[0] + flux[1] + flux[2];
}

}  // namespace

TEST_CASE("streamed mesh: under a small cap it gives nearly the container of a large one",
          "[integration][build][streamed]") {
  // 320,000 triangles take 43 MB with what rays need
  const TemporaryDirectory dir;
  write_waves(dir / "waves.ply", 400);
  BuildRequest request;
  request.inputs = {dir / "waves.ply"};
  request.sampling.count = 40'000;
  LightRig rig;
  rig.suns.push_back({glm::normalize(glm::vec3(1, 1, 0.3F)), glm::vec3(2), 0.01F});
  rig.sky.radiance = glm::vec3(0.3F);
  request.lights = rig;
  request.run = {.memory_bytes = std::uint64_t{1} << 30, .threads = 2};
  Notes in_memory, streamed;
  const BuildReport large = build_container(request, dir / "large.ptcx", in_memory);
  request.run.memory_bytes = std::uint64_t{128} << 20;
  const BuildReport small = build_container(request, dir / "small.ptcx", streamed);
  CHECK(!tells(in_memory, "do not fit in memory"));
  CHECK(tells(streamed, "do not fit in memory"));
  Progress silent;
  CHECK(verify_container(dir / "small.ptcx", {}, silent).damage == 0);
  CHECK(static_cast<double>(small.superblock.points) ==
        Approx(static_cast<double>(large.superblock.points)).epsilon(0.01));
  CHECK(flux_of(dir / "small.ptcx") == Approx(flux_of(dir / "large.ptcx")).epsilon(0.02));

  // Every cap under which the mesh does not fit gives the same bytes, and so do threads
  request.run = {.memory_bytes = std::uint64_t{140} << 20, .threads = 3};
  build_container(request, dir / "other.ptcx", silent);
  CHECK(ContainerReader(dir / "other.ptcx").superblock().content_xxh3 ==
        ContainerReader(dir / "small.ptcx").superblock().content_xxh3);

  // Where all is dark, no light is looked for
  const auto is_lit = [](const BuildReport& report) {
    return std::ranges::any_of(report.seconds, [](const auto& s) { return s.first == "light"; });
  };
  CHECK(is_lit(small));
  request.lights = LightRig{};
  CHECK_FALSE(is_lit(build_container(request, dir / "other.ptcx", silent)));
  CHECK(flux_of(dir / "other.ptcx") == 0);

  // A camera sees the surfels where the mesh does not fit, and nearly the same
  const auto render = [&](std::uint64_t bytes, Progress& progress) {
    RenderRequest picture{{.scene = dir / "large.ptcx", .run = {.memory_bytes = bytes}}};
    picture.meshes = {dir / "waves.ply"};
    picture.size = {{96, 54}};
    const PictureTarget target{dir / "picture.exr"};
    render_picture(picture, {&target, 1}, progress);
    const Image image = read_image(dir / "picture.exr");
    glm::dvec3 sum(0);
    for (const glm::vec3& pixel : image.pixels) sum += glm::dvec3(pixel);
    return sum.x + sum.y + sum.z;
  };
  Notes seen;
  const double of_mesh = render(std::uint64_t{1} << 30, silent);
  CHECK(render(std::uint64_t{150} << 20, seen) == Approx(of_mesh).epsilon(0.05));
  CHECK(tells(seen, "the camera sees the surfels"));
}
