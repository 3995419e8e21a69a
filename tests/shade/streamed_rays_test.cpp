// Rays at a container part by part, compared with rays at all of it.
#include "engine/shade/reference/streamed_rays.h"

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

TEST_CASE("streamed rays: tracing part by part gives the result of the whole scene",
          "[shade][rays]") {
  Scene scene(small_scene(0.02));
  add_floor_receivers(scene.receivers, 0.02);
  const auto receivers = std::span<const Receiver>(scene.receivers).first(300);
  const std::uint64_t points = scene.container->superblock().points;
  REQUIRE(points * (sizeof(Surfel) + DiscRays::kBytes) < (64U << 20));
  REQUIRE(points * (sizeof(Surfel) + DiscRays::kBytes) > StreamedRays::kMinBytes);
  const ThreadPool executor(2);
  const auto sky = [](const glm::vec3& d) { return glm::vec3(1 + d.z); };
  const auto trace = [&](std::uint64_t memory_bytes) {
    std::vector<Shading> results(receivers.size());
    Progress silent;
    StreamedRays rays(*scene.container, Sides::both, sky, memory_bytes);
    rays.trace(receivers, 400, 7, results, executor, silent);
    return results;
  };
  const std::vector<Shading> whole = trace(std::uint64_t{128} << 20),
                             parts = trace(StreamedRays::kMinBytes);
  double covered = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    covered += static_cast<double>(whole[i].occlusion);
    CHECK(parts[i].occlusion == whole[i].occlusion);
    CHECK(parts[i].irradiance == whole[i].irradiance);
    CHECK(parts[i].sky == whole[i].sky);
    CHECK(parts[i].bent_normal == whole[i].bent_normal);
  }
  CHECK(covered > 10);

  const std::vector<Surfel> surfels = load_surfels(*scene.container, points);
  const DiscRays rays(surfels, Sides::both, sky);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    CHECK(rays.trace(receivers[i], 400, 7 + i).occlusion ==
          Approx(whole[i].occlusion).margin(0.003));
  }
}

TEST_CASE("streamed rays: an empty scene covers nothing", "[shade][rays]") {
  const Scene scene({});
  const std::vector<Receiver> receivers{{{0, 0, 0}, {0, 0, 1}}};
  std::vector<Shading> results(1);
  Progress silent;
  StreamedRays rays(
      *scene.container, Sides::both, [](const glm::vec3&) { return glm::vec3(1); },
      StreamedRays::kMinBytes);
  rays.trace(receivers, 64, 0, results, ThreadPool(1), silent);
  CHECK(results[0].occlusion == 0);
  CHECK(results[0].sky.x == Approx(3.14159265F));
}
