// Payloads: how each of them describes surfels, compared with the surfels themselves.
#include "tools/bench/experiments/payload.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/cloud/record.h"
#include "engine/octree/subtree.h"
#include "format/node_layout.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

std::vector<glm::vec3> directions() {
  std::vector<Surfel> sphere;
  test::add_sphere(sphere, {0, 0, 0}, 1, 0.2, {});
  std::vector<glm::vec3> all;
  for (const Surfel& s : sphere) all.push_back(s.normal);
  return all;
}

/// A cluster of surfels as a container stores them; fit() gives the numbers of a payload for it.
struct Cluster {
  explicit Cluster(const std::vector<Surfel>& from) {
    const test::SortedScene sorted = test::sort_scene(from);
    summary = summarise_points(sorted.records, sorted.frame.unit());
    for (const PointRecord& record : sorted.records)
      surfels.push_back(to_surfel(record, sorted.frame));
  }
  [[nodiscard]] std::vector<float> fit(const Payload& payload) const {
    std::vector<float> numbers(payload.count());
    payload.fit(summary, surfels, numbers.data());
    return numbers;
  }
  NodeSummary summary;
  std::vector<Surfel> surfels;
};

/// Returns the RMS errors over directions, over the mean: of the facing area, and of its light.
std::array<double, 2> errors_of(const Payload& payload, const std::vector<float>& numbers,
                                const Cluster& cluster) {
  double area = 0, light = 0, area_off = 0, light_off = 0;
  for (const glm::vec3& d : directions()) {
    const Seen ours = payload.see(numbers.data(), d), truth = see_exactly(cluster.surfels, d);
    const double lit = static_cast<double>(truth.front * truth.radiance.g);
    area += static_cast<double>(truth.front);
    light += lit;
    area_off += std::pow(static_cast<double>(ours.front - truth.front), 2);
    light_off += std::pow(static_cast<double>(ours.front * ours.radiance.g) - lit, 2);
  }
  const auto n = static_cast<double>(directions().size());
  return {std::sqrt(area_off / n) / (area / n), std::sqrt(light_off / n) / (light / n)};
}

/// The three walls of a corner, each with its own size and colour.
Cluster corner() {
  std::vector<Surfel> surfels;
  test::add_rectangle(surfels, {0, 0, 0}, {1, 0, 0}, {0, 3, 0}, 0.25, {1, 0.2F, 0.1F});
  test::add_rectangle(surfels, {0, 0, 0}, {0, 3, 0}, {0, 0, 2}, 0.25, {0.1F, 1, 0.3F});
  test::add_rectangle(surfels, {0, 0, 0}, {0, 0, 2}, {1, 0, 0}, 0.25, {0.2F, 0.3F, 2});
  return Cluster(surfels);
}

}  // namespace

TEST_CASE("payload: products of harmonics add up to Legendre polynomials", "[bench][payload]") {
  std::array<float, 25> a{}, b{};
  for (const glm::vec3& d : directions()) {
    const glm::vec3 other = glm::normalize(glm::vec3(0.3F, -0.5F, 0.8F));
    spherical_harmonics(4, d, a.data());
    spherical_harmonics(4, other, b.data());
    for (unsigned l = 0; l <= 4; ++l) {
      double sum = 0;
      for (std::size_t i = l * l; i < (l + 1) * (l + 1); ++i)
        sum += static_cast<double>(a[i] * b[i]);
      CHECK(sum ==
            Approx(std::legendre(l, std::clamp(static_cast<double>(glm::dot(d, other)), -1.0, 1.0)))
                .margin(1e-5));
    }
  }
}

TEST_CASE("payload: every payload except the harmonics is exact for a wall of one colour",
          "[bench][payload]") {
  std::vector<Surfel> surfels;
  test::add_rectangle(surfels, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0.25, {1, 0.5F, 0.25F});
  const Cluster wall(surfels);
  for (const Payload& payload : payloads()) {
    CAPTURE(payload.name);
    const auto [area, light] = errors_of(payload, wall.fit(payload), wall);
    const bool waves = std::string(payload.name).starts_with("SH");
    CHECK((area < 1e-3) == !waves);
    CHECK((light < 1e-3) == !waves);
  }
}

TEST_CASE("payload: larger payloads are more exact for a corner of three colours",
          "[bench][payload]") {
  const Cluster cluster = corner();
  std::map<std::string, std::array<double, 2>> found;
  for (const Payload& payload : payloads())
    found[payload.name] = errors_of(payload, cluster.fit(payload), cluster);
  const auto light = [&](const char* name) { return found.at(name)[1]; };
  CHECK(light("two lobes") < 0.7 * light("surfel"));
  CHECK(light("cube") < 0.7 * light("surfel"));
  for (const std::size_t k : {0U, 1U}) {
    CAPTURE(k);
    CHECK(found.at("SH 1")[k] < 0.7 * found.at("SH 0")[k]);
    CHECK(found.at("SH 2")[k] < 0.7 * found.at("SH 1")[k]);
    CHECK(found.at("SH 4")[k] < 0.7 * found.at("SH 2")[k]);
  }
}

TEST_CASE("payload: the cube and 24 bytes of bounds are as large as a child of spec/nodes.md",
          "[bench][payload]") {
  const auto cube = std::ranges::find(payloads(), std::string("cube"), &Payload::name);
  REQUIRE(cube != payloads().end());
  const std::size_t four_children =
      round_to_slot(group_content_bytes(8, false)) - round_to_slot(group_content_bytes(4, false));
  CHECK(4 * (cube->stored_bytes() + 24) == four_children);
}
