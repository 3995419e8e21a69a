// Rays of a camera through the octree of a container, compared with a test of every disc in double.
#include "engine/trace/camera_tracer.h"

#include <cmath>
#include <fstream>
#include <optional>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/shade/reference/brute_force.h"
#include "format/error.h"
#include "tests/shade/gather_scene.h"
#include "tests/trace/wild_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr unsigned kSide = 32;  // samples along the side of a tile

/// What a camera sees: where it stands, and its axes.
struct Eye {
  glm::dvec3 position;
  glm::mat3 axes;
  float width = 0.6F;  ///< of the picture at a distance of 1

  Eye(const glm::dvec3& from, const glm::dvec3& to, float wide) : position(from), width(wide) {
    const glm::vec3 forward(glm::normalize(to - from));
    const glm::vec3 right = glm::normalize(glm::cross(forward, glm::vec3(0.1F, 0.3F, 1)));
    axes = {right, glm::cross(forward, right), forward};
  }

  /// Returns the rays of a tile, eight neighbours after eight.
  [[nodiscard]] std::vector<glm::vec3> rays() const {
    std::vector<glm::vec3> all;
    for (unsigned i = 0; i < kSide * kSide; ++i) {
      const unsigned x = i / 8 % (kSide / 4) * 4 + i % 4, y = i / (2 * kSide) * 2 + i / 4 % 2;
      const auto at = [&](unsigned k) {
        return width * ((static_cast<float>(k) + 0.5F) / static_cast<float>(kSide) - 0.5F);
      };
      all.push_back(axes * glm::vec3(at(x), at(y), 1));
    }
    return all;
  }
};

/// What a ray sees by the test of every disc.
struct Truth {
  std::optional<std::size_t> point;
  bool back = false;
  bool sure = true;  ///< false when rounding decides
};

Truth nearest_disc(const std::vector<Surfel>& surfels, const Eye& eye, const glm::dvec3& along) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  double least = kFar, second = kFar, doubtful = kFar;
  Truth truth;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const Surfel& s = surfels[i];
    const glm::dvec3 normal = glm::normalize(glm::dvec3(s.normal)), to = s.position - eye.position;
    const double radius = static_cast<double>(s.radius), slope = glm::dot(along, normal);
    const double t = glm::dot(to, normal) / slope, e = glm::length(along * t - to);
    const double slack = 1e-4 * radius + 1e-5 * std::abs(t),
                 edge = slack / std::max(1e-3, std::abs(slope));
    if (!(t > 0) || e > radius + edge) continue;
    const double depth = t + 0.01 * e * e / radius;
    if (e > radius - edge || std::abs(slope) < 1e-3) {
      doubtful = std::min(doubtful, depth - edge);
    } else if (depth < least) {
      second = std::exchange(least, depth);
      truth.point = i;
      truth.back = slope > 0;
    } else {
      second = std::min(second, depth);
    }
  }
  truth.sure = std::min(second, doubtful) > least * (1 + 1e-5) || least == second;
  if (least == kFar) truth.sure = doubtful == kFar;
  return truth;
}

/// Compares what the samples of a tile see with all discs. @return the number that see a back
std::size_t check_tile(const Scene& scene, const std::vector<Surfel>& surfels, const Eye& eye,
                       double least_sure) {
  const SceneView view(*scene.container);
  PageCache cache(*scene.container, {.memory_bytes = 64U << 20});
  CameraTracer tracer(view, cache, eye.position, eye.axes);
  const std::vector<glm::vec3> rays = eye.rays();
  std::vector<RayHit> hits(rays.size());
  tracer.meet(rays, hits);
  std::size_t wrong = 0, sure = 0, met = 0, backs = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Truth truth = nearest_disc(surfels, eye, rays[i]);
    if (!truth.sure) continue;
    ++sure;
    const std::optional<std::size_t> point =
        hits[i].met() ? std::optional<std::size_t>(hits[i].point) : std::nullopt;
    wrong += point != truth.point || (point && hits[i].back != truth.back) ? 1U : 0U;
    met += truth.point ? 1U : 0U;
    backs += truth.point && truth.back ? 1U : 0U;
  }
  CAPTURE(sure, met, backs);
  CHECK(wrong == 0);
  CHECK(static_cast<double>(sure) > least_sure * static_cast<double>(rays.size()));
  CHECK(met > sure / 20);
  return backs;
}

}  // namespace

TEST_CASE("camera: a sample sees the nearest disc of all, from afar, near, and from within",
          "[trace][camera]") {
  const Scene scene(small_scene(0.05));
  const std::vector<Surfel> surfels = load_surfels(*scene.container, 1'000'000);
  CHECK(check_tile(scene, surfels, Eye({4, -6, 5}, {0, 0, 0.3}, 0.6F), 0.6) == 0);
  check_tile(scene, surfels, Eye({-1, -1.9, 0.4}, {0.5, 0.5, 0.3}, 1.5F), 0.6);
  check_tile(scene, surfels, Eye({0.2, 0.1, 0.05}, {0.2, 1.5, 0.5}, 3), 0.6);
  // From below, where the backs of the floor hide all else
  CHECK(check_tile(scene, surfels, Eye({0, 0, -2}, {0.3, 0, 0}, 0.5F), 0.6) > 400);
}

TEST_CASE("camera: it sees the back of a disc however near", "[trace][camera]") {
  const Scene scene(small_scene(0.05));
  const std::vector<Surfel> surfels = load_surfels(*scene.container, 1'000'000);
  CHECK(check_tile(scene, surfels, Eye({0.21, 0.13, -0.01}, {0.21, 0.13, 1}, 1), 0.5) > 400);
}

TEST_CASE("camera: so it does among discs of all sizes, turned at random", "[trace][camera]") {
  const Scene scene(wild_scene());
  // A camera sees the first of discs at one place, and load_surfels() keeps their order
  const std::vector<Surfel> surfels = load_surfels(*scene.container, 1'000'000);
  check_tile(scene, surfels, Eye({3, 1, 2}, {0, 0, 0}, 0.7F), 0.6);
  check_tile(scene, surfels, Eye({0, 0, 0}, {1, 0.2, 0.1}, 2), 0.6);
}

TEST_CASE("camera: a sample sees the same in a tile and alone", "[trace][camera]") {
  const Scene scene(wild_scene());
  const SceneView view(*scene.container);
  PageCache cache(*scene.container, {.memory_bytes = 64U << 20});
  const Eye eye({0.1, 0.2, 0.1}, {1, 0.2, 0.1}, 2);
  CameraTracer tracer(view, cache, eye.position, eye.axes);
  const std::vector<glm::vec3> rays = eye.rays();
  std::vector<RayHit> together(rays.size());
  tracer.meet(rays, together);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RayHit alone;
    tracer.meet({&rays[i], 1}, {&alone, 1});
    REQUIRE(alone.depth == together[i].depth);
    REQUIRE(alone.point == together[i].point);
  }
}

TEST_CASE("camera: points of lost pages are not seen, nor what lies below lost groups",
          "[trace][camera]") {
  const Scene scene(small_scene(0.025));
  const Eye eye({4, -6, 5}, {0, 0, 0.3}, 0.6F);
  const std::vector<glm::vec3> rays = eye.rays();
  const auto bytes = bytes_of(scene.dir / "scene.ptcx");
  const auto see = [&](std::optional<std::uint32_t> broken, bool tolerate) {
    auto changed = bytes;
    if (broken) {
      char& byte = changed[scene.container->entry(*broken).offset + kPageHeaderBytes];
      byte = static_cast<char>(~byte);
    }
    std::ofstream(scene.dir / "broken.ptcx", std::ios::binary)
        .write(changed.data(), static_cast<std::streamsize>(changed.size()));
    const ContainerReader container(scene.dir / "broken.ptcx");
    LostPages lost(container);
    const SceneView view(container, tolerate ? &lost : nullptr);
    PageCache cache(container, {.memory_bytes = 64U << 20});
    CameraTracer tracer(view, cache, eye.position, eye.axes);
    std::vector<RayHit> hits(rays.size());
    tracer.meet(rays, hits);
    CHECK(lost.list().size() <= (tolerate && broken ? 1U : 0U));
    return hits;
  };
  const std::vector<RayHit> whole = see({}, true);
  // Points
  const std::uint64_t point = std::ranges::find_if(whole, &RayHit::met)->point;
  const SceneView view(*scene.container);
  const std::uint32_t page = view.point_page(point);
  CHECK_THROWS_AS(see(page, false), FormatError);
  const std::vector<RayHit> found = see(page, true);
  std::size_t gone = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (whole[i].met() && view.point_page(whole[i].point) == page) {
      ++gone;
      CHECK((!found[i].met() || view.point_page(found[i].point) != page));
    } else {
      CHECK(found[i].point == whole[i].point);
    }
  }
  CHECK(gone > 0);
  // Groups
  std::size_t kept = 0, lost_sight = 0;
  const std::uint32_t root = view.node_page(view.root().page);
  for (const std::uint32_t nodes : scene.container->node_pages()) {
    if (nodes == root) {
      CHECK_THROWS_AS(see(nodes, false), FormatError);
      CHECK_THROWS_AS(see(nodes, true), FormatError);
      continue;
    }
    const std::vector<RayHit> seen = see(nodes, true);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const bool same = seen[i].point == whole[i].point && seen[i].met() == whole[i].met();
      if (whole[i].met()) ++(same ? kept : lost_sight);
      CHECK((same || seen[i].depth > whole[i].depth));
    }
  }
  CHECK(kept > 0);
  CHECK(lost_sight > 0);
}
