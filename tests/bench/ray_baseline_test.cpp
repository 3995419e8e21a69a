// The ray tracer that PTCX is measured against, compared with the oracle of engine/shade.
#include "tools/bench/references/ray_baseline.h"

#include <cmath>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "engine/shade/reference/brute_force.h"
#include "tests/support/scenes.h"
#include "tools/bench/chart/statistics.h"

using namespace ptc;
using namespace ptc::bench;
using Job = RayBaseline::Job;
using Packets = RayBaseline::Packets;

namespace {

constexpr double kSpacing = 0.05;

/// A floor in front of a red wall, with balls on it.
std::vector<Surfel> balls_before_a_wall() {
  std::vector<Surfel> surfels;
  test::add_rectangle(surfels, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, kSpacing, glm::vec3(0.5F));
  test::add_rectangle(surfels, {-2, 1.5, 0}, {4, 0, 0}, {0, 0, 2}, kSpacing, {0.8F, 0.1F, 0.1F});
  for (int i = 0; i < 5; ++i) {
    const glm::vec3 colour(0.2F * static_cast<float>(i), 0.6F, 0.3F);
    test::add_sphere(surfels, {-1.5 + 0.7 * i, -1 + 0.4 * (i * 3 % 5), 0.3}, 0.28, kSpacing,
                     colour);
  }
  return surfels;
}

/// Returns receivers on the floor.
std::vector<Receiver> floor_receivers() {
  std::vector<Receiver> receivers;
  for (int j = 0; j < 8; ++j) {
    for (int i = 0; i < 8; ++i)
      receivers.push_back({{-1.6 + 0.43 * i, -1.6 + 0.37 * j, 0.01}, {0, 0, 1}});
  }
  return receivers;
}

struct Difference {
  ErrorStatistics occlusion, irradiance;  // relative to their means
};

/// @param ours, theirs  return the result of a receiver, given the receiver and its index
template <class Ours, class Theirs>
Difference compare(const std::vector<Receiver>& receivers, const Ours& ours, const Theirs& theirs) {
  std::vector<float> a, b, light_a, light_b;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const Shading one = ours(receivers[i], i), other = theirs(receivers[i], i);
    a.push_back(one.occlusion);
    b.push_back(other.occlusion);
    light_a.insert(light_a.end(), {one.irradiance.r, one.irradiance.g, one.irradiance.b});
    light_b.insert(light_b.end(), {other.irradiance.r, other.irradiance.g, other.irradiance.b});
  }
  return {over_mean(error_statistics(a, b)), over_mean(error_statistics(light_a, light_b))};
}

auto trace_with(const RayBaseline& rays, Job job, Packets packets, unsigned count,
                std::uint64_t seed = 0) {
  return [&rays, job, packets, count, seed](const Receiver& receiver, std::size_t i) {
    return rays.trace(receiver, job, packets, count, seed + i);
  };
}

}  // namespace

TEST_CASE("ray baseline: discs give the results of the oracle, with both sides and fronts alone",
          "[bench][rays]") {
  const std::vector<Surfel> surfels = balls_before_a_wall();
  for (const Sides sides : {Sides::both, Sides::front}) {
    const RayBaseline rays(surfels, sides);
    const DiscRays oracle(surfels, sides, {});
    const Difference errors =
        compare(floor_receivers(), trace_with(rays, Job::bleeding, Packets::sixteen, 8192),
                [&](const Receiver& receiver, std::size_t i) {
                  return oracle.trace(receiver, 8100, 5000 + i);
                });
    CHECK(errors.occlusion.reference_mean > 0.1);
    CHECK(errors.irradiance.reference_mean > 0.1);
    CHECK(errors.occlusion.rms < 0.006);
    CHECK(errors.irradiance.rms < 0.008);
    CHECK(std::abs(errors.occlusion.bias) < 0.001);
    CHECK(std::abs(errors.irradiance.bias) < 0.001);
  }
}

TEST_CASE("ray baseline: a mesh gives the results of its surfels as discs", "[bench][rays]") {
  // A wall above a floor: discs cover both except for their rims.
  Mesh mesh{.origin = {50, 60, 70}};
  mesh.positions = {{-2, -2, 0},   {2, -2, 0},   {2, 2, 0},    {-2, 2, 0},
                    {-2, 1.5F, 0}, {2, 1.5F, 0}, {2, 1.5F, 2}, {-2, 1.5F, 2}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  std::vector<Surfel> surfels;
  test::add_rectangle(surfels, mesh.origin + glm::dvec3(-2, -2, 0), {4, 0, 0}, {0, 4, 0}, kSpacing,
                      glm::vec3(0.5F));
  test::add_rectangle(surfels, mesh.origin + glm::dvec3(-2, 1.5, 0), {4, 0, 0}, {0, 0, 2}, kSpacing,
                      {0.8F, 0.1F, 0.1F});
  std::vector<Receiver> receivers = floor_receivers();
  for (Receiver& r : receivers) r.position += mesh.origin;
  std::erase_if(receivers,
                [](const Receiver& r) { return r.position.y > 61.3; });  // not behind the wall
  const RayBaseline discs(surfels, Sides::both), triangles(mesh, surfels, kSpacing);
  const Difference errors =
      compare(receivers, trace_with(triangles, Job::bleeding, Packets::sixteen, 4096),
              trace_with(discs, Job::bleeding, Packets::sixteen, 4096));
  CHECK(errors.irradiance.reference_mean > 0.05);
  CHECK(errors.occlusion.rms < 0.012);
  CHECK(errors.irradiance.rms < 0.015);
}

TEST_CASE("ray baseline: the back of a disc covers and is black", "[bench][rays]") {
  Mesh mesh;
  mesh.positions = {{-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  std::vector<Surfel> surfels;
  test::add_rectangle(surfels, {-9, -9, 0}, {18, 0, 0}, {0, 18, 0}, 0.25, glm::vec3(0.5F));
  const RayBaseline discs(surfels, Sides::both), triangles(mesh, surfels, 0.25);
  const Receiver under{{0, 0, -1}, {0, 0, 1}}, over{{0, 0, 1}, {0, 0, -1}};
  for (const RayBaseline* rays : {&discs, &triangles}) {
    for (const Packets packets : {Packets::single, Packets::sixteen}) {
      const Shading back = rays->trace(under, Job::bleeding, packets, 256, 0);
      CHECK(back.occlusion > 0.95F);
      CHECK(back.irradiance == glm::vec3(0));
      CHECK(rays->trace(over, Job::bleeding, packets, 256, 0).irradiance.g > 1.4F);
    }
  }
}

TEST_CASE("ray baseline: single rays and packets with one seed differ only in ties",
          "[bench][rays]") {
  const std::vector<Surfel> surfels = balls_before_a_wall();
  const RayBaseline rays(surfels, Sides::both);
  for (const Job job : {Job::occlusion, Job::bleeding}) {
    const Difference errors =
        compare(floor_receivers(), trace_with(rays, job, Packets::single, 1024),
                trace_with(rays, job, Packets::sixteen, 1024));
    CHECK(errors.occlusion.rms < 1e-3);
    if (job == Job::bleeding) CHECK(errors.irradiance.rms < 2e-3);
  }
}

TEST_CASE("ray baseline: any-hit rays find the occlusion of closest-hit rays", "[bench][rays]") {
  const std::vector<Surfel> surfels = balls_before_a_wall();
  const RayBaseline rays(surfels, Sides::both);
  for (const Packets packets : {Packets::single, Packets::sixteen}) {
    for (const Receiver& receiver : floor_receivers()) {
      const Shading any = rays.trace(receiver, Job::occlusion, packets, 1024, 3);
      CHECK(any.occlusion ==
            Approx(rays.trace(receiver, Job::bleeding, packets, 1024, 3).occlusion).margin(0.0011));
      CHECK(any.irradiance == glm::vec3(0));
    }
  }
}

TEST_CASE("ray baseline: errors fall faster than one over the root of the rays", "[bench][rays]") {
  const std::vector<Surfel> surfels = balls_before_a_wall();
  const RayBaseline rays(surfels, Sides::both);
  const auto truth = trace_with(rays, Job::bleeding, Packets::sixteen, 65536, 1'000'000);
  const Difference few =
      compare(floor_receivers(), trace_with(rays, Job::bleeding, Packets::sixteen, 128), truth);
  const Difference many =
      compare(floor_receivers(), trace_with(rays, Job::bleeding, Packets::sixteen, 1024), truth);
  const double root = std::sqrt(1024.0 / 128);
  CHECK(few.occlusion.rms > 1.2 * root * many.occlusion.rms);
  CHECK(few.irradiance.rms > 1.2 * root * many.irradiance.rms);
}

TEST_CASE("ray baseline: the same seed gives the same result, another seed another",
          "[bench][rays]") {
  const std::vector<Surfel> surfels = balls_before_a_wall();
  const RayBaseline rays(surfels, Sides::both);
  const Receiver receiver = floor_receivers()[27];
  const auto trace = [&](std::uint64_t seed) {
    return rays.trace(receiver, Job::bleeding, Packets::sixteen, 64, seed).irradiance;
  };
  CHECK(trace(1) == trace(1));
  CHECK(trace(1) != trace(2));
}

TEST_CASE("ray baseline: numbers of rays other than powers of two from 16 to 65536 are refused",
          "[bench][rays]") {
  const std::vector<Surfel> surfels = balls_before_a_wall();
  const RayBaseline rays(surfels, Sides::both);
  const Receiver receiver{{0, 0, 1}, {0, 0, 1}};
  for (const unsigned count : {0U, 1U, 8U, 15U, 17U, 100U, 65535U, 131072U, 1U << 31, ~0U}) {
    CHECK_THROWS_AS(rays.trace(receiver, Job::occlusion, Packets::sixteen, count, 0),
                    std::invalid_argument);
  }
  for (unsigned count = 16; count <= 65536; count *= 2) {
    CHECK_NOTHROW(rays.trace(receiver, Job::occlusion, Packets::single, count, 0));
  }
}

TEST_CASE("ray baseline: without discs nothing is covered", "[bench][rays]") {
  const RayBaseline rays(std::span<const Surfel>(), Sides::both);
  const Shading shading =
      rays.trace({{0, 0, 0}, {0, 0, 1}}, Job::bleeding, Packets::sixteen, 64, 0);
  CHECK(shading.occlusion == 0);
  CHECK(shading.irradiance == glm::vec3(0));
}
