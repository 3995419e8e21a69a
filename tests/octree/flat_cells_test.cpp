// Flat cells: what becomes one surfel, what it is, and what stays as it is.
#include "engine/octree/flat_cells.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/cloud/record.h"
#include "format/scalar.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr Flatness kLoose{.height = 0.2, .turn = 0.4, .contrast = 0.2, .growth = 8, .reach = 1.5};

bool goes_on_everywhere(const PointRecord& /*disc*/, float /*finest*/) {
  return true;
}

struct Merged {
  std::vector<Surfel> surfels;
  std::vector<PointRecord> records;
  MergeCounts counts;
};

Merged merge(const std::vector<Surfel>& surfels, const Flatness& most = kLoose,
             const SurfaceGoesOn& goes_on = goes_on_everywhere, std::size_t block = 777) {
  const SortedScene scene = sort_scene(surfels);
  VectorStream stream(scene.records, block);
  Merged merged;
  const auto from = merge_flat_cells(stream, scene.frame.unit(), most, goes_on, merged.counts);
  std::vector<PointRecord> part(block);
  while (const std::size_t count = from->next(part))
    merged.records.insert(merged.records.end(), part.begin(),
                          part.begin() + static_cast<std::ptrdiff_t>(count));
  for (const PointRecord& record : merged.records)
    merged.surfels.push_back(to_surfel(record, scene.frame));
  return merged;
}

/// Returns a wall of 64 x 64 surfels at x = 1/3, seen from +x.
std::vector<Surfel> wall(const glm::vec3& radiance = {0.5F, 0.25F, 1}) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {1.0 / 3, 0, 0}, {0, 1, 0}, {0, 0, 1}, 1.0 / 64, radiance);
  return surfels;
}

double area_of(const std::vector<Surfel>& surfels) {
  double area = 0;
  for (const Surfel& s : surfels) area += 2 * double{s.radius} * double{s.radius};
  return area;
}

}  // namespace

TEST_CASE("flat cells: one surfel stands for a square of a wall", "[build][merge]") {
  const std::vector<Surfel> before = wall();
  const Merged after = merge(before);
  REQUIRE(before.size() == 4096);
  // Surfels grow by up to eight times, so that each takes 64
  CHECK(after.surfels.size() == 64);
  CHECK(after.counts.points == 4096);
  CHECK(after.counts.merged == 4096);
  CHECK(after.counts.made == 64);
  CHECK(after.counts.light_error() == 0);
  CHECK(area_of(after.surfels) == Approx(1).epsilon(1e-3));
  for (const Surfel& s : after.surfels) {
    CHECK(s.position.x == Approx(1.0 / 3).margin(1e-6));
    CHECK(std::abs(s.normal.x) == Approx(1));
    CHECK(s.radius == Approx(8 / 64.0 / std::sqrt(2.0)).epsilon(1e-3));
    CHECK(s.radiance.x == 0.5F);
    CHECK(s.radiance.y == 0.25F);
    CHECK(s.radiance.z == 1);
    // It lies in the middle of its square
    const double y = s.position.y * 8 - 0.5, z = s.position.z * 8 - 0.5;
    CHECK(std::abs(y - std::round(y)) < 1e-4);
    CHECK(std::abs(z - std::round(z)) < 1e-4);
  }
  CHECK(std::ranges::is_sorted(after.records, {}, &PointRecord::key));
}

TEST_CASE("flat cells: surfels grow as far as they may", "[build][merge]") {
  for (const double growth : {1.0, 2.1, 4.1}) {
    Flatness most = kLoose;
    most.growth = growth;
    const double each = std::floor(growth) * std::floor(growth);
    CHECK(static_cast<double>(merge(wall(), most).surfels.size()) == Approx(4096 / each));
  }
}

TEST_CASE("flat cells: the edge of a shadow keeps its surfels, and all light is kept",
          "[build][merge]") {
  std::vector<Surfel> surfels = wall({1, 1, 1});
  constexpr double kEdge = 0.4;  // within a cell
  glm::dvec3 light(0);
  for (Surfel& s : surfels) {
    if (s.position.y < kEdge) s.radiance = glm::vec3(0.1F);
    light += glm::dvec3(s.radiance) * 2.0 * double{s.radius} * double{s.radius};
  }
  const Merged after = merge(surfels);
  CHECK(after.surfels.size() > 64);
  CHECK(after.surfels.size() < 1200);
  glm::dvec3 kept(0);
  for (const Surfel& s : after.surfels) {
    const bool dark = s.radiance.x<0.11F, bright = s.radiance.x> 0.99F;
    CHECK((dark || bright));
    kept += glm::dvec3(s.radiance) * 2.0 * double{s.radius} * double{s.radius};
  }
  CHECK(kept.x == Approx(light.x).epsilon(1e-3));
}

TEST_CASE("flat cells: the change of light is told as it is", "[build][merge]") {
  // Two kinds of rows, 10 % apart: a tenth over 1 +- 0.05 is off by 0.05 / sqrt(1.0025)
  std::vector<Surfel> surfels = wall({1, 1, 1});
  for (Surfel& s : surfels) {
    const bool odd = static_cast<int>(s.position.y * 64) % 2 == 1;
    s.radiance = glm::vec3(odd ? 1.05F : 0.95F);
  }
  const Merged even = merge(surfels);
  CHECK(even.surfels.size() == 64);
  CHECK(even.counts.light_error() == Approx(0.05 / std::sqrt(1.0025)).epsilon(0.01));
  CHECK(even.counts.albedo_error() == 0);
  Flatness strict = kLoose;
  strict.contrast = 0.04;
  CHECK(merge(surfels, strict).surfels.size() == 4096);
}

TEST_CASE("flat cells: what bends, what lies behind each other and what ends stays",
          "[build][merge]") {
  // A ball of few surfels bends too much; one of many does not
  std::vector<Surfel> coarse, fine;
  add_sphere(coarse, {0, 0, 0}, 1, 0.5, {1, 1, 1});
  add_sphere(fine, {0, 0, 0}, 1, 0.02, {1, 1, 1});
  Flatness strict = kLoose;
  strict.turn = 0.1;
  CHECK(merge(coarse, strict).counts.merged == 0);
  CHECK(merge(fine).surfels.size() < fine.size() / 4);
  // A wall that is rough by half a radius
  std::vector<Surfel> rough = wall();
  const std::vector<Surfel> front = wall();
  for (std::size_t i = 0; i < rough.size(); ++i)
    rough[i].position.x += (i * 7 % 4 < 2 ? 0.5 : -0.5) * double{rough[i].radius};
  CHECK(merge(rough).counts.merged == 0);
  // Twice as many surfels as a wall takes, at other places of it
  std::vector<Surfel> twice = wall();
  for (Surfel s : front) {
    s.position.y += 1.0 / 1024;
    twice.push_back(s);
  }
  CHECK(merge(twice).counts.merged == 0);
  // The surface ends everywhere
  const auto ends = [](const PointRecord& /*disc*/, float /*finest*/) { return false; };
  CHECK(merge(wall(), kLoose, ends).surfels.size() == 4096);
}

TEST_CASE("flat cells: both sides of a sheet are merged, each for itself", "[build][merge]") {
  // At the same places, and 1e-3 behind
  for (const double gap : {0.0, 1e-3}) {
    std::vector<Surfel> sheet = wall();
    for (Surfel s : wall({0.1F, 0.1F, 0.1F})) {
      s.position.x -= gap;
      s.normal = -s.normal;
      sheet.push_back(s);
    }
    const Merged after = merge(sheet);
    CHECK(after.surfels.size() == 128);
    CHECK(std::ranges::is_sorted(after.records, {}, &PointRecord::key));
    const auto is_front = [](const Surfel& s) { return s.normal.x > 0; };
    CHECK(std::ranges::count_if(after.surfels, is_front) == 64);
    for (const Surfel& s : after.surfels)
      CHECK(s.radiance.z == Approx(is_front(s) ? 1 : 0.1).epsilon(1e-3));
  }
}

TEST_CASE("flat cells: points at one place and without a radius stay, however many there are",
          "[build][merge]") {
  std::vector<Surfel> surfels = wall();
  for (std::size_t i = 0; i < 5000; ++i) surfels.push_back(surfels[17]);
  for (std::size_t i = 0; i < 100; ++i) {
    surfels.push_back(surfels[1000 + i]);
    surfels.back().position.y += 1e-4;
    surfels.back().radius = 0;
  }
  const Merged after = merge(surfels);
  const auto count = [](const std::vector<Surfel>& all, const auto& is) {
    return std::ranges::count_if(all, is);
  };
  const auto is_point = [](const Surfel& s) { return s.radius == 0; };
  const auto is_there = [&](const Surfel& s) {
    return glm::distance(s.position, surfels[17].position) < 1e-9;
  };
  CHECK(count(after.surfels, is_point) == 100);
  CHECK(count(after.surfels, is_there) == 5001);
  CHECK(after.counts.points == surfels.size());
  CHECK(after.surfels.size() == surfels.size() - after.counts.merged + after.counts.made);
}

TEST_CASE("flat cells: a side of which little is left does not hold up the other",
          "[build][merge]") {
  // A wall, and one surfel at its beginning that faces the other way
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {1.0 / 3, 0, 0}, {0, 1, 0}, {0, 0, 1}, 1.0 / 512, {1, 1, 1});
  surfels.push_back(surfels.front());
  surfels.back().normal = -surfels.back().normal;
  const SortedScene scene = sort_scene(surfels);
  VectorStream stream(scene.records);
  MergeCounts counts;
  const SurfaceGoesOn goes_on = goes_on_everywhere;
  const auto merged = merge_flat_cells(stream, scene.frame.unit(), kLoose, goes_on, counts);
  std::vector<PointRecord> one(1);
  REQUIRE(merged->next(one) == 1);
  CHECK(counts.points < surfels.size() / 10);  // the first surfel is there before the last was read
}

TEST_CASE("flat cells: what goes out stays in order, wherever a side begins and ends",
          "[build][merge]") {
  // A slope whose cells are filled on the diagonal, so that their means lie before their points;
  // patches of it face the other way, and other patches both ways
  for (const unsigned patch : {3U, 16U, 40U}) {
    std::vector<Surfel> slope, surfels;
    add_rectangle(slope, {0, 1, 0}, {1, -1, 0}, {0, 0, 1}, 1.0 / 200, {1, 1, 1});
    for (std::size_t i = 0; i < slope.size(); ++i) {
      const auto x = static_cast<unsigned>(slope[i].position.x * 283) / patch,
                 z = static_cast<unsigned>(slope[i].position.z * 200) / patch;
      Surfel other = slope[i];
      other.normal = -other.normal;
      const unsigned kind = (x * 7 + z * 13) % 5;
      if (kind != 0) surfels.push_back(slope[i]);
      if (kind < 2) surfels.push_back(other);
    }
    const Merged all = merge(surfels);
    CHECK(all.counts.merged > surfels.size() / 4);
    CHECK(std::ranges::is_sorted(all.records, {}, &PointRecord::key));
    CHECK(all.surfels.size() == surfels.size() - all.counts.merged + all.counts.made);
    CHECK(area_of(all.surfels) == Approx(area_of(surfels)).epsilon(1e-3));
  }
}

TEST_CASE("flat cells: no surfel comes before one that went out", "[build][merge]") {
  // The 4,096 points that are read first end with one in a corner of a cell, which goes out at
  // once. Two of the other side then fill two more corners, and their mean lies before that point
  std::vector<Surfel> surfels;
  const Surfel up{.normal = {0, 0, 1}, .radius = 0.1F, .radiance = glm::vec3(1)};
  const auto add = [&](double x, double y, float radius, float side) {
    surfels.push_back(up);
    surfels.back().position = {x, y, 0.5};
    surfels.back().normal.z = side;
    surfels.back().radius = radius;
  };
  for (int i = 0; i < 4095; ++i) add(8 * (i % 64), 8 * (i / 64), 0.1F, 1);
  add(512.49, 512.49, 0, 1);
  add(512.7, 512.2, 0.4F, -1);
  add(512.2, 512.7, 0.4F, -1);
  add(1000, 1000, 0.1F, 1);
  const Merged after = merge(surfels);
  CHECK(std::ranges::is_sorted(after.records, {}, &PointRecord::key));
  CHECK(after.surfels.size() == surfels.size());
  // Without that point they become one
  surfels.erase(surfels.begin() + 4095);
  CHECK(merge(surfels).surfels.size() == surfels.size() - 1);
}

TEST_CASE("flat cells: blocks do not matter", "[build][merge]") {
  const std::vector<Surfel> surfels = small_scene(0.02);
  const Merged all = merge(surfels), one = merge(surfels, kLoose, goes_on_everywhere, 1);
  CHECK(all.counts.merged > surfels.size() / 2);
  REQUIRE(all.records.size() == one.records.size());
  CHECK(std::ranges::equal(all.records, one.records, {}, &PointRecord::key, &PointRecord::key));
  CHECK(std::ranges::is_sorted(all.records, {}, &PointRecord::key));
}
