// Holes in pictures of surfels: closed where they are as wide as the distance of points, left where
// they are wider.
#include "engine/pipeline/render/splat_holes.h"

#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "format/scalar.h"

using namespace ptc;

namespace {

constexpr unsigned kSide = 64;
constexpr float kFocal = 100;

/// A picture of a plane at depth 1 in a frame of edge 1, whose discs have a radius of 2 samples.
class Plane {
 public:
  Plane() {
    SplatSample sample{.depth = 1, .payload = {}};
    sample.payload.radius = encode_ufloat16(2 / kFocal);
    sample.payload.albedo = {10, 20, 30};
    samples_.assign(std::size_t{kSide} * kSide, sample);
  }

  SplatSample& at(unsigned x, unsigned y) { return samples_[y * kSide + x]; }
  void cut(unsigned x0, unsigned y0, unsigned width, unsigned height,
           const SplatSample& seen = {}) {
    for (unsigned y = y0; y < y0 + height; ++y) {
      for (unsigned x = x0; x < x0 + width; ++x) at(x, y) = seen;
    }
  }
  std::size_t close(float widest = std::numeric_limits<float>::infinity()) {
    return close_holes({.samples = samples_,
                        .width = kSide,
                        .height = kSide,
                        .focal = kFocal,
                        .scale = SceneScale(Frame{}),
                        .widest = widest},
                       ThreadPool(2));
  }

 private:
  std::vector<SplatSample> samples_;
};

}  // namespace

TEST_CASE("splat holes: a gap between discs is closed by what is around it", "[render]") {
  Plane plane;
  plane.cut(20, 30, 3, 3);
  CHECK(plane.close() == 9);
  CHECK(plane.at(21, 31).depth == Approx(1));
  CHECK(plane.at(21, 31).payload.albedo == std::array<std::uint8_t, 3>{10, 20, 30});
}

TEST_CASE("splat holes: wide discs close no wider holes than they may", "[render]") {
  Plane plane;
  plane.cut(20, 20, 7, 7);  // from its middle to the rim are less than four radii
  plane.cut(50, 50, 1, 1);
  CHECK(plane.close(0.5F / kFocal) == 1);
  CHECK(plane.at(23, 23).empty());
  CHECK(plane.at(50, 50).depth == Approx(1));
  CHECK(plane.close() == 49);
}

TEST_CASE("splat holes: a surface behind does not show through a gap", "[render]") {
  Plane plane;
  SplatSample behind{.depth = 5, .payload = {}};
  behind.payload.radius = encode_ufloat16(2 / kFocal);
  plane.cut(20, 30, 2, 2, behind);
  CHECK(plane.close() == 4);
  CHECK(plane.at(20, 30).depth == Approx(1));
}

TEST_CASE("splat holes: windows, silhouettes and near steps stay", "[render]") {
  Plane plane;
  plane.cut(10, 10, 14, 14);  // a window much wider than a disc
  plane.cut(40, 0, 24, 64);   // a silhouette
  CHECK(plane.at(17, 17).empty());
  static_cast<void>(plane.close());
  CHECK(plane.at(17, 17).empty());
  CHECK(plane.at(45, 30).empty());
  CHECK(plane.at(40, 30).empty());
  // A step of one radius is no hole
  Plane steps;
  SplatSample step = steps.at(0, 0);
  step.depth = 1.02F;
  steps.cut(20, 20, 1, 1, step);
  CHECK(steps.close() == 0);
  // Nothing is closed where nothing is seen
  Plane empty;
  empty.cut(0, 0, kSide, kSide);
  CHECK(empty.close() == 0);
}

TEST_CASE("splat holes: the back of a disc beside a rim is closed, no farther than a radius or so",
          "[render]") {
  Plane plane;
  SplatSample behind{.depth = 1.04F, .payload = {}};  // two radii
  behind.payload.radius = encode_ufloat16(2 / kFocal);
  plane.cut(40, 0, 24, 64, behind);
  CHECK(plane.close() == 0);
  behind.payload.back = true;
  plane.cut(40, 0, 24, 64, behind);
  static_cast<void>(plane.close());
  CHECK(plane.at(41, 30).depth == Approx(1));
  CHECK_FALSE(plane.at(41, 30).payload.back);
  CHECK(plane.at(42, 30).payload.back);
}
