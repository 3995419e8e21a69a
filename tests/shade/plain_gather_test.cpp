// Two independent gathers must agree on a single receiver.
#include "engine/shade/reference/plain_gather.h"

#include <catch2/catch.hpp>

#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// The results of both gathers, which shade every receiver alone.
struct Pair {
  std::vector<Shading> shared, plain;
  GatherCounts shared_counts, plain_counts;
};

Pair shade_alone(const Scene& scene, const GatherOptions& options) {
  const SceneView view(*scene.container);
  PageCache cache(*scene.container, {.memory_bytes = 64U << 20, .threads = 2});
  Gather gather(view, cache, options);
  PlainGather plain(view, cache, options);
  const DirectionGrid grid(options.resolution,
                           [](const glm::vec3& d) { return glm::vec3(1 + d.z); });
  Pair pair;
  for (const Receiver& receiver : scene.receivers) {
    pair.shared.emplace_back();
    gather.shade({&receiver, 1}, {&pair.shared.back(), 1}, grid);
    pair.plain.push_back(plain.shade(receiver, grid));
  }
  pair.shared_counts = gather.counts();
  pair.plain_counts = plain.counts();
  return pair;
}

}  // namespace

TEST_CASE("plain gather: a lone receiver gets the result of the hierarchical gather",
          "[shade][gather]") {
  // Surfaces have flat clusters; a cloud with random normals does not.
  std::vector<Surfel> surfels = small_scene(0.04);
  const std::vector<Surfel> cloud = random_surfels(3000, 7);
  surfels.insert(surfels.end(), cloud.begin(), cloud.end());
  Scene scene(surfels);
  add_floor_receivers(scene.receivers, 0.04);
  for (const Sides sides : {Sides::both, Sides::front}) {
    for (const float solid_angle : {0.1F, 0.01F}) {
      const Pair pair = shade_alone(scene, {.solid_angle = solid_angle, .sides = sides});
      const Errors e = compare(pair.shared, pair.plain);
      CAPTURE(solid_angle, sides == Sides::both, e.occlusion_rms, e.irradiance_rms);
      CHECK(e.occlusion_rms < 2e-4);  // a pixel on a disc's rim is one of 3,072 over the horizon
      CHECK(e.irradiance_rms < 1e-3);
      for (std::size_t i = 0; i < pair.plain.size(); ++i) {
        CHECK(glm::dot(pair.shared[i].bent_normal, pair.plain[i].bent_normal) > 0.999F);
        CHECK(pair.shared[i].sky.g == Approx(pair.plain[i].sky.g).margin(0.01));
      }
      // Only one of them tests the cone of normals, which saves clusters that show their backs.
      CHECK(pair.plain_counts.clusters >= pair.shared_counts.clusters);
      if (sides == Sides::both)
        CHECK(pair.plain_counts.surfels == Approx(pair.shared_counts.surfels).epsilon(0.001));
    }
  }
}

TEST_CASE("plain gather: nothing is seen in an empty scene", "[shade][gather]") {
  Scene scene({});
  scene.receivers.push_back({{0, 0, 0}, {0, 0, 1}});
  CHECK(shade_alone(scene, {}).plain[0].occlusion == 0);
}

TEST_CASE("gather: groups that are children of two nodes are an error, not an endless walk",
          "[shade][gather]") {
  for (const char* name : {"itself", "cycle", "fan"}) {
    INFO(name);
    const ContainerReader container(PTC_SOURCE_DIR "/spec/vectors/verify/nodes-references." +
                                    std::string(name) + ".ptcx");
    const SceneView view(container);
    PageCache cache(container, {.memory_bytes = 64U << 20, .threads = 2});
    const GatherOptions options{.solid_angle = 1e-12F};
    const DirectionGrid grid(options.resolution, [](const glm::vec3&) { return glm::vec3(1); });
    const std::vector<Receiver> receivers{{{0, 0, -9}, {0, 0, 1}}, {{9, 0, -9}, {0, 0, 1}}};
    std::vector<Shading> results(receivers.size());
    Gather gather(view, cache, options);
    PlainGather plain(view, cache, options);
    const auto refusal = Catch::Matches(container.path().string() + ".*spec/nodes.md#references.*");
    CHECK_THROWS_WITH(gather.shade(receivers, results, grid), refusal);
    CHECK_THROWS_WITH(
        gather.shade(std::span(receivers).first(1), std::span(results).first(1), grid), refusal);
    CHECK_THROWS_WITH(plain.shade(receivers[0], grid), refusal);
  }
}
