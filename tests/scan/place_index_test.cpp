#include "engine/scan/place_index.h"

#include <algorithm>
#include <random>

#include <catch2/catch.hpp>

using namespace ptc;

namespace {

std::vector<LatticePosition> walk(std::size_t count) {
  std::mt19937_64 bits(5);
  std::vector<LatticePosition> places;
  LatticePosition p{1e6, 1e6, 1e6};
  for (std::size_t i = 0; i < count; ++i) {
    for (double& x : p) x += static_cast<double>(bits() % 201) - 100;
    places.push_back(p);
  }
  return places;
}

PlaceIndex index_of(const std::vector<LatticePosition>& places, std::uint64_t bytes) {
  PlaceIndex index(bytes);
  for (const LatticePosition& p : places) index.add(p);
  index.finish();
  return index;
}

LatticeBox box_of(const std::vector<LatticePosition>& places, const PlaceIndex& index,
                  std::size_t page) {
  LatticeBox box;
  const std::size_t first = page * index.page_places();
  for (std::size_t i = first; i < std::min(first + index.page_places(), places.size()); ++i)
    box.add(places[i]);
  return box;
}

}  // namespace

TEST_CASE("place index: a box finds the pages that it overlaps, in order", "[scan][index]") {
  for (const std::size_t count : {0U, 1U, 255U, 256U, 257U, 100'000U}) {
    const auto places = walk(count);
    const PlaceIndex index = index_of(places, 1 << 20);
    REQUIRE(index.places() == count);
    REQUIRE(index.pages() == (count + 255) / 256);
    std::vector<std::uint32_t> found;
    for (std::size_t i = 0; i < 50; ++i) {
      LatticeBox box;
      box.add(count > 0 ? places[i * 1999 % count] : LatticePosition{});
      box = box.grown(static_cast<double>(i * i));
      std::vector<std::uint32_t> expected;
      for (std::size_t page = 0; page < index.pages(); ++page) {
        if (box_of(places, index, page).overlaps(box))
          expected.push_back(static_cast<std::uint32_t>(page));
      }
      index.overlapping(box, found);
      REQUIRE(found == expected);
    }
  }
}

TEST_CASE("place index: pages double until their boxes fit in memory", "[scan][index]") {
  const auto places = walk(300'000);
  const PlaceIndex index = index_of(places, 1 << 16);
  CHECK(index.page_places() == 1024);  // 455 pages may be held; 293 are enough
  REQUIRE(index.pages() == 293);
  std::vector<std::uint32_t> found;
  for (std::size_t page = 0; page < index.pages(); ++page) {
    index.overlapping(box_of(places, index, page), found);
    REQUIRE(std::ranges::find(found, page) != found.end());
  }
}

TEST_CASE("place index: the nearest pages come by increasing distance, each once",
          "[scan][index]") {
  const auto places = walk(50'000);
  const PlaceIndex index = index_of(places, 1 << 20);
  NearestPages nearest(index, places[1234]);
  std::vector<std::uint32_t> seen;
  double last = 0;
  while (const auto page = nearest.next()) {
    REQUIRE(page->squared == box_of(places, index, page->page).squared_distance(places[1234]));
    REQUIRE(page->squared >= last);
    last = page->squared;
    seen.push_back(page->page);
  }
  std::ranges::sort(seen);
  REQUIRE(seen.size() == index.pages());
  for (std::size_t i = 0; i < seen.size(); ++i) REQUIRE(seen[i] == i);
}
