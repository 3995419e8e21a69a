// The rows of `ptcbench stability` keep to their bounds.
#include <limits>
#include <set>
#include <string>

#include <catch2/catch.hpp>

#include "engine/parallel/thread_pool.h"
#include "tests/support/temporary_directory.h"
#include "tools/bench/stability/row.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

void check_rows(std::span<const Row> rows) {
  const test::TemporaryDirectory dir;
  const ThreadPool executor;
  const Lab lab{dir.path(), executor};
  for (const Row& row : rows) {
    INFO("row " << row.number << ", " << row.scene);
    const Outcome outcome = row.measure(lab);
    CHECK_FALSE(outcome.figures.empty());
    for (const Bounded& figure : outcome.figures) {
      INFO(figure.what << ": " << figure.value << ", at most " << figure.bound);
      CHECK(figure.holds());
    }
    const Field& field = outcome.field;
    CHECK(field.ours.size() == std::size_t{field.width} * field.height);
    CHECK(field.truth.size() == field.ours.size());
  }
}

}  // namespace

TEST_CASE("stability: surfaces that meet, touch or overlap", "[stability]") {
  check_rows(rows_of_contacts());
}

TEST_CASE("stability: single discs, direction pixels and cells", "[stability]") {
  check_rows(rows_of_pixels());
}

TEST_CASE("stability: walls keep light out, and show each side its own", "[stability]") {
  check_rows(rows_of_walls());
}

TEST_CASE("stability: what moves does not jump", "[stability]") {
  check_rows(rows_of_motion());
}

TEST_CASE("stability: pictures of a camera or an object that moves do not flicker", "[stability]") {
  check_rows(rows_of_pictures());
}

TEST_CASE("stability: pictures show no seams with eight times the contrast", "[stability]") {
  check_rows(rows_of_seams());
}

TEST_CASE("stability: inputs that are odd, huge or turned", "[stability]") {
  check_rows(rows_of_inputs());
}

TEST_CASE("stability: all failures from 1 to 33 have a row", "[stability]") {
  std::set<std::string> numbers;
  for (const Row& row : all_rows()) numbers.insert(row.number);
  for (int number = 1; number <= 33; ++number) {
    CAPTURE(number);
    CHECK(numbers.contains(std::to_string(number)));
  }
  CHECK(numbers.size() == 33);
}

TEST_CASE("stability: a value that is no number keeps to no bound", "[stability]") {
  CHECK(Bounded{.value = 1, .bound = 1}.holds());
  CHECK_FALSE(Bounded{.value = 1.001, .bound = 1}.holds());
  CHECK_FALSE(Bounded{.value = std::numeric_limits<double>::quiet_NaN(), .bound = 1}.holds());
  const std::vector<glm::vec3> zero(2),
      odd{glm::vec3(0), glm::vec3(std::numeric_limits<float>::quiet_NaN())};
  CHECK(std::isnan(largest_difference(zero, odd)));
  CHECK(std::isnan(rms_difference(zero, odd)));
}
