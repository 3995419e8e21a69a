// Labels next to points.
#include "tools/bench/chart/label_placer.h"

#include <catch2/catch.hpp>

using namespace ptc;

namespace {

constexpr Box kArea{0, 0, 100, 100};

bool overlap(const Box& a, const Box& b) {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}

}  // namespace

TEST_CASE("labels: the boxes around a spot keep their distance and their size", "[chart][labels]") {
  const auto boxes = boxes_around({50, 40}, 6, 20, 10);
  for (const Box& box : boxes) {
    CHECK(box.width() == Approx(20));
    CHECK(box.height() == Approx(10));
    CHECK_FALSE(overlap(box, {46.5, 36.5, 53.5, 43.5}));
  }
  CHECK(boxes[0].left > 50);  // above right
  CHECK(boxes[0].bottom < 40);
}

TEST_CASE("labels: the first box is taken where nothing is in the way", "[chart][labels]") {
  LabelPlacer placer(kArea);
  const auto boxes = boxes_around({50, 40}, 6, 20, 10);
  const auto box = placer.place(boxes);
  REQUIRE(box);
  CHECK(box->left == boxes[0].left);
  CHECK(box->top == boxes[0].top);
}

TEST_CASE("labels: no label leaves the area or covers a marker or another label",
          "[chart][labels]") {
  LabelPlacer placer(kArea);
  const Box marker{60, 60, 66, 66};
  placer.block(marker);
  std::vector<Box> placed;
  for (int i = 0; i < 40; ++i) {
    const int row = i / 3;
    const Spot spot{10.0 * (i % 11), 9.0 * row};
    const auto box = placer.place(boxes_around(spot, 6, 18, 9));
    if (!box) continue;
    CHECK((box->left >= 0 && box->top >= 0 && box->right <= 100 && box->bottom <= 100));
    CHECK_FALSE(overlap(*box, marker));
    for (const Box& other : placed) CHECK_FALSE(overlap(*box, other));
    placed.push_back(*box);
  }
  CHECK(placed.size() > 10);
  CHECK(placed.size() < 40);
}

TEST_CASE("labels: a label without room is not placed", "[chart][labels]") {
  LabelPlacer placer(kArea);
  placer.block({0, 0, 100, 100});
  CHECK_FALSE(placer.place(boxes_around({50, 50}, 6, 20, 10)));
  CHECK_FALSE(LabelPlacer(kArea).place(boxes_around({50, 50}, 6, 101, 10)));
}

TEST_CASE("labels: lines are avoided, and crossed only where they are everywhere",
          "[chart][labels]") {
  LabelPlacer placer(kArea);
  placer.avoid({50, 40}, {80, 10});  // through the box above right
  const auto boxes = boxes_around({50, 40}, 6, 20, 10);
  const auto box = placer.place(boxes);
  REQUIRE(box);
  CHECK(box->right <= 50);
  LabelPlacer crowded(kArea);
  for (int y = 0; y <= 100; y += 2) {
    crowded.avoid({0, static_cast<double>(y)}, {100, static_cast<double>(y)});
  }
  CHECK(crowded.place(boxes));
}
