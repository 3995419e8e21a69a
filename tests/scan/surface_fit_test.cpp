#include "engine/scan/surface_fit.h"

#include <cmath>
#include <cstring>
#include <memory>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <hwy/targets.h>

#include "tests/scan/clouds.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Puts a neighbour into a lane.
void add(FitBatch& batch, std::size_t lane, const glm::dvec3& p) {
  const auto row = static_cast<std::size_t>(batch.count[lane]);
  batch.x[row][lane] = static_cast<float>(p.x);
  batch.y[row][lane] = static_cast<float>(p.y);
  batch.z[row][lane] = static_cast<float>(p.z);
  batch.count[lane] += 1;
  batch.rows = std::max(batch.rows, row + 1);
}

/// Returns a random position in the unit disc.
glm::dvec3 in_disc(Random& random) {
  while (true) {
    const glm::dvec3 p(2 * random.uniform() - 1, 2 * random.uniform() - 1, 0);
    if (glm::length(p) < 1) return p;
  }
}

/// Angle between the normal of a lane and a line, degrees.
double angle_to(const FitLanes& fit, std::size_t lane, const glm::dvec3& truth) {
  const glm::dvec3 n(fit.normal[0][lane], fit.normal[1][lane], fit.normal[2][lane]);
  return std::acos(std::min(1.0, std::abs(glm::dot(n, glm::normalize(truth))))) * 57.29578;
}

}  // namespace

TEST_CASE("surface fit: the normal of a plane in any direction is exact", "[scan][fit]") {
  const auto batch = std::make_unique<FitBatch>();
  const auto fit = std::make_unique<FitLanes>();
  Random random(3);
  std::array<glm::dvec3, kFitLanes> normals;
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    const glm::dvec3 n = normals[lane] =
        lane < 3 ? glm::dvec3(lane == 0, lane == 1, lane == 2)
                 : glm::normalize(glm::dvec3(random.normal(), random.normal(), random.normal()));
    const glm::dvec3 u = glm::normalize(
        glm::cross(n, std::abs(n.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
    const glm::dvec3 v = glm::cross(n, u);
    for (std::size_t i = 0; i < 8 + lane; ++i) {
      const glm::dvec3 p = in_disc(random);
      add(*batch, lane, 0.7 * (u * p.x + v * p.y) + 0.1 * n);
    }
  }
  fit_surfaces(*batch, *fit);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    CHECK(angle_to(*fit, lane, normals[lane]) < 0.02);
    CHECK(fit->noise[lane] < 1e-3F);
    CHECK(std::abs(std::abs(fit->offset[lane]) - 0.1F) < 1e-3F);
    CHECK(fit->flatness[lane] > 0.999F);
  }
}

TEST_CASE("surface fit: curvature does not turn the normal, however points lie", "[scan][fit]") {
  const auto batch = std::make_unique<FitBatch>();
  const auto fit = std::make_unique<FitLanes>();
  Random random(4);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    for (int i = 0; i < 16; ++i) {
      glm::dvec3 p = in_disc(random) + glm::dvec3(0.2, 0.1, 0);  // not even around the point
      p.z = 0.2 * p.x * p.x - 0.1 * p.x * p.y + 0.15 * p.y * p.y;
      add(*batch, lane, p);
    }
  }
  fit_surfaces(*batch, *fit);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) CHECK(angle_to(*fit, lane, {0, 0, 1}) < 0.5);
}

TEST_CASE("surface fit: a few points off the surface do not turn the normal", "[scan][fit]") {
  const auto batch = std::make_unique<FitBatch>();
  const auto fit = std::make_unique<FitLanes>();
  Random random(5);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    for (int i = 0; i < 40; ++i) {
      glm::dvec3 p = in_disc(random);
      if (i < 3) p = glm::dvec3(p.x / 2, p.y / 2, 0.5);
      add(*batch, lane, p);
    }
  }
  fit_surfaces(*batch, *fit);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane)
    CHECK(angle_to(*fit, lane, {0, 0, 1}) < 2);  // with equal weights up to 5
}

TEST_CASE("surface fit: a strip between two edges has its own normal", "[scan][fit]") {
  // The front of a slab, 0.7 high, with 7 of 16 points; the others lie on its top and its bottom
  const auto batch = std::make_unique<FitBatch>();
  const auto fit = std::make_unique<FitLanes>();
  Random random(7);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    const auto along = [&] { return 1.6 * random.uniform() - 0.8; };
    for (int i = 0; i < 16; ++i) {
      const double depth = 0.6 * random.uniform();
      const glm::dvec3 front(0, along(), 0.7 * random.uniform() - 0.35);
      const glm::dvec3 side(depth, along(), i % 2 == 0 ? 0.35 : -0.35);
      add(*batch, lane, i % 5 < 2 ? front : side);
    }
  }
  fit_surfaces(*batch, *fit);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    CHECK(angle_to(*fit, lane, {1, 0, 0}) < 4);
    CHECK(fit->noise[lane] < 0.02F);
    CHECK(fit->scatter[lane] >= fit->noise[lane]);
  }
}

TEST_CASE("surface fit: three points, one or none give finite numbers", "[scan][fit]") {
  const auto batch = std::make_unique<FitBatch>();
  const auto fit = std::make_unique<FitLanes>();
  Random random(6);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    for (std::size_t i = 0; i < lane % 5; ++i) add(*batch, lane, in_disc(random));
  }
  for (int i = 0; i < 5; ++i) add(*batch, 5, {0, 0, 0});         // at the point itself
  for (int i = 1; i < 6; ++i) add(*batch, 10, {i / 5.0, 0, 0});  // on a line
  fit_surfaces(*batch, *fit);
  const auto* numbers = reinterpret_cast<const float*>(fit.get());
  for (std::size_t i = 0; i < sizeof(FitLanes) / sizeof(float); ++i)
    REQUIRE(std::isfinite(numbers[i]));
  CHECK(fit->width[10] < 0.01F);
}

TEST_CASE("surface fit: all instruction sets give the same bits", "[scan][fit]") {
  const auto batch = std::make_unique<FitBatch>();
  Random random(7);
  for (std::size_t lane = 0; lane < kFitLanes; ++lane) {
    for (std::size_t i = 0; i < 10 + 2 * lane; ++i) {
      glm::dvec3 p = in_disc(random);
      p.z = 0.3 * p.x * p.y + 0.05 * random.normal();
      add(*batch, lane, p);
    }
  }
  const auto first = std::make_unique<FitLanes>(), other = std::make_unique<FitLanes>();
  fit_surfaces(*batch, *first);
  unsigned sets = 0;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().DeInit();
    fit_surfaces(*batch, *other);
    CAPTURE(hwy::TargetName(target));
    CHECK(std::memcmp(first.get(), other.get(), sizeof(FitLanes)) == 0);
    ++sets;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().DeInit();
  CHECK(sets > 1);
}
