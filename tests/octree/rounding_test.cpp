// Rounded points: within the documented bounds, in order, and rounded only once.
#include "engine/octree/rounding.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/cloud/record.h"
#include "engine/parallel/thread_pool.h"
#include "format/scalar.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

std::vector<PointRecord> rounded(const std::vector<PointRecord>& records, const Frame& frame,
                                 std::size_t block = 777, const PointRounding& rounding = {}) {
  VectorStream stream(records, block);
  const ThreadPool executor(2);
  const std::unique_ptr<PointStream> from =
      round_points(stream, frame.unit(), executor, {}, rounding);
  std::vector<PointRecord> out(records.size()), part(block);
  std::size_t at = 0;
  while (const std::size_t count = from->next(part)) {
    std::copy_n(part.begin(), count, out.begin() + static_cast<std::ptrdiff_t>(at));
    at += count;
  }
  REQUIRE(at == records.size());
  return out;
}

/// Surfels whose radii differ by factors up to 2^20 and that lie in heaps, so that rounded cells
/// meet.
std::vector<Surfel> heaps() {
  std::vector<Surfel> surfels = random_surfels(20000, 5);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    Surfel& s = surfels[i];
    s.radius = std::ldexp(s.radius, -static_cast<int>(i % 20));
    if (i % 2 == 0) s.position = surfels[i % 200].position + 1e-5 * s.position;
    s.radiance *= std::ldexp(1.0F, static_cast<int>(i % 17) - 8);
  }
  return surfels;
}

}  // namespace

TEST_CASE("rounding: a point is rounded the same, whatever block it comes in",
          "[build][rounding]") {
  SortedScene scene = sort_scene(heaps());
  const std::vector<PointRecord> one = rounded(scene.records, scene.frame, 1);
  const std::vector<PointRecord> all = rounded(scene.records, scene.frame, scene.records.size());
  CHECK(std::ranges::equal(one, all, {}, &PointRecord::key, &PointRecord::key));
  std::size_t moved_by_others =
      0;  // points moved by an earlier one: without any, the blocks could not matter
  for (std::size_t i = 1; i < all.size(); ++i) {
    moved_by_others += rounded({scene.records[i]}, scene.frame, 1)[0].key != all[i].key;
  }
  CHECK(moved_by_others > 100);
}

TEST_CASE("rounding: points stay in order and within the bounds", "[build][rounding]") {
  const SortedScene scene = sort_scene(heaps());
  const std::vector<PointRecord> records = rounded(scene.records, scene.frame);
  CHECK(std::ranges::is_sorted(records, {}, &PointRecord::key));
  double position = 0, radius = 0, normal = 0, radiance = 0;
  std::size_t moved = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Surfel was = to_surfel(scene.records[i], scene.frame),
                 is = to_surfel(records[i], scene.frame);
    moved += records[i].key != scene.records[i].key;
    position = std::max(position,
                        glm::distance(was.position, is.position) / static_cast<double>(is.radius));
    radius = std::max(
        radius, std::abs(static_cast<double>(is.radius) / static_cast<double>(was.radius) - 1));
    const glm::dvec3 a(was.normal), b(is.normal);
    normal = std::max(normal, std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)));
    for (int c = 0; c < 3; ++c) {
      const double from = static_cast<double>(was.radiance[c]),
                   off = std::abs(static_cast<double>(is.radiance[c]) - from);
      radiance = std::max(radiance,
                          std::min(from > 0 ? off / from : off, off / 0x1p-22 * kRoundedRadiance));
    }
    REQUIRE(records[i].albedo == scene.records[i].albedo);
  }
  CHECK(moved > records.size() / 2);
  CHECK(position <= kRoundedPosition);
  CHECK(radius <= kRoundedRadius);
  CHECK(normal <= kRoundedNormal);
  CHECK(radiance <= kRoundedRadiance);
  // The bounds are tight: half of them would be too small.
  CHECK(position > 0.5 * kRoundedPosition);
  CHECK(radius > 0.5 * kRoundedRadius);
  CHECK(normal > 0.5 * kRoundedNormal);
  CHECK(radiance > 0.5 * kRoundedRadiance);
}

TEST_CASE("rounding: rounded points stay as they are, whatever the blocks", "[build][rounding]") {
  const SortedScene scene = sort_scene(heaps());
  const std::vector<PointRecord> once = rounded(scene.records, scene.frame);
  const auto same = [&](const std::vector<PointRecord>& other) {
    return std::ranges::equal(once, other, [](const PointRecord& a, const PointRecord& b) {
      return a.key == b.key && a.radius == b.radius && a.normal == b.normal &&
             a.radiance == b.radiance;
    });
  };
  CHECK(same(rounded(once, scene.frame)));
  CHECK(same(rounded(scene.records, scene.frame, 1)));
}

TEST_CASE("rounding: axes, range ends and points without radius stay as they are",
          "[build][rounding]") {
  Frame frame;
  std::vector<PointRecord> records(5);
  for (std::size_t i = 0; i < records.size(); ++i)
    records[i].key = encode_morton({12345 + 2 * i, 777, 4242});
  records[0].normal = {32767, 0};
  records[1].normal = {0, -32767};
  records[2].radiance = {0x7bff, 0x8000, 1};
  records[3].radius = std::numeric_limits<float>::max();
  records[4].radius = -0.0F;
  const std::vector<PointRecord> out = rounded(records, frame);
  for (const std::size_t i : {0U, 1U, 2U}) CHECK(out[i].key == records[i].key);
  CHECK(out[0].normal == records[0].normal);
  CHECK(out[1].normal == records[1].normal);
  CHECK(out[2].radiance == std::array<std::uint16_t, 3>{0x7bf8, 0, 0});
  CHECK(std::isfinite(out[3].radius));
  CHECK(out[4].radius == 0);
}

TEST_CASE("rounding: fewer bits make the errors that their text tells", "[build][rounding]") {
  CHECK(rounding_text() == "position 0.001 radius, radius 1/512, normal 0.0021, radiance 1/256");
  constexpr PointRounding kCoarse{
      .position = 0.02, .radius_bits = 5, .normal_bits = 6, .radiance_bits = 4};
  CHECK(rounding_text(kCoarse) == "position 0.02 radius, radius 1/64, normal 0.034, radiance 1/32");
  const SortedScene scene = sort_scene(heaps());
  const std::vector<PointRecord> records = rounded(scene.records, scene.frame, 777, kCoarse);
  CHECK(std::ranges::is_sorted(records, {}, &PointRecord::key));
  double position = 0, radius = 0, normal = 0, radiance = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Surfel was = to_surfel(scene.records[i], scene.frame),
                 is = to_surfel(records[i], scene.frame);
    position = std::max(position, glm::distance(was.position, is.position) / double{is.radius});
    radius = std::max(radius, std::abs(double{is.radius} / double{was.radius} - 1));
    const glm::dvec3 a(was.normal), b(is.normal);
    normal = std::max(normal, std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)));
    if (was.radiance.x > 1e-3F)
      radiance = std::max(radiance, std::abs(double{is.radiance.x} / double{was.radiance.x} - 1));
    REQUIRE(records[i].albedo == scene.records[i].albedo);
  }
  CHECK(position <= 0.02);
  CHECK(position > 0.01);
  CHECK(radius <= 1.0 / 64);
  CHECK(radius > 0.5 / 64);
  CHECK(normal <= 0.034);
  CHECK(normal > 0.017);
  CHECK(radiance <= 1.0 / 32);
  CHECK(radiance > 0.5 / 32);
  // Rounded once more, nothing changes
  const std::vector<PointRecord> again = rounded(records, scene.frame, 777, kCoarse);
  CHECK(std::ranges::equal(again, records, {}, &PointRecord::key, &PointRecord::key));
  CHECK(std::ranges::equal(again, records, {}, &PointRecord::radius, &PointRecord::radius));
}
