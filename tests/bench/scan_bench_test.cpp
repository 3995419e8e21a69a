// Clouds that are drawn from meshes, and the sides of their normals.
#include "tools/bench/experiments/scan_bench.h"

#include <algorithm>
#include <filesystem>

#include <catch2/catch.hpp>

#include "tools/bench/scenes/sampled_cloud.h"

using namespace ptc;
using namespace ptc::bench;

TEST_CASE("scan: what the walls of a house enclose is not drawn", "[bench][scan]") {
  // The floors of the city's houses are a fifth of its area, and face down as its ledges do.
  const Mesh mesh = mesh_of(parse_scene("city"), 100'000, {});
  const RayScene rays(mesh);
  const auto points = sample_at_random(rays, {.points = 100'000});
  const auto faces_down = [](const SampledPoint& p) { return p.normal.y < -0.9F; };
  const auto down = static_cast<double>(std::ranges::count_if(points, faces_down));
  CHECK(points.size() > 40'000);
  CHECK(down < 0.12 * static_cast<double>(points.size()));
}

TEST_CASE("scan: walls of a city have a side where slabs divide them", "[bench][scan]") {
  Progress silent;
  const SceneScans city =
      measure_scans(parse_scene("city"), {.points = 2'000'000, .noises = {0}, .repeats = 1},
                    std::filesystem::temp_directory_path(), {}, silent);
  CHECK(city.rows.at(0).flipped < 0.06);  // without the votes of patches: 0.08
}
