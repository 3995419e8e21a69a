#include "engine/sort/point_streams.h"

#include <stdexcept>
#include <thread>

#include <catch2/catch.hpp>

#include "tests/sort/records.h"

namespace ptc {
namespace {

/// Yields numbered records in blocks of a size, and throws after so many records if it is told to.
class Numbers : public PointStream {
 public:
  Numbers(std::size_t count, std::size_t block, std::size_t throws_after)
      : count_(count), block_(block), throws_after_(throws_after) {}

  std::size_t next(std::span<PointRecord> out) override {
    readers_different = readers_different || std::this_thread::get_id() != caller_;
    if (done_ >= throws_after_) throw std::runtime_error("broken");
    const std::size_t count = std::min({out.size(), block_, count_ - done_});
    for (std::size_t i = 0; i < count; ++i) out[i] = test::numbered({}, done_ + i);
    done_ += count;
    return count;
  }

  bool readers_different = false;  ///< another thread than the one that made this has read

 private:
  std::thread::id caller_ = std::this_thread::get_id();
  std::size_t count_, block_, throws_after_, done_ = 0;
};

constexpr std::size_t kNever = ~std::size_t{0};

}  // namespace

TEST_CASE("read_ahead: another thread reads the same points", "[sort][streams]") {
  for (const std::size_t count : {0UL, 1UL, 16384UL, 100'001UL}) {
    for (const std::size_t block : {1000UL, 1UL << 20}) {
      CAPTURE(count, block);
      Numbers numbers(count, block, kNever), expected(count, block, kNever);
      const auto ahead = read_ahead(numbers);
      std::vector<PointRecord> found(count + 1), wanted(count + 1);
      CHECK(read_full(*ahead, found) == count);
      CHECK(read_full(expected, wanted) == count);
      CHECK(test::same_bytes(found, wanted));
      CHECK(ahead->next(found) == 0);
      CHECK(numbers.readers_different);
    }
  }
}

TEST_CASE("read_ahead: what is thrown arrives behind the points before it", "[sort][streams]") {
  Numbers numbers(100'000, 1000, 50'000);
  const auto ahead = read_ahead(numbers);
  std::vector<PointRecord> found(50'000);
  CHECK(read_full(*ahead, found) == 50'000);
  CHECK_THROWS_WITH(ahead->next(found), "broken");
}

TEST_CASE("read_ahead: a stream may end before all points are taken", "[sort][streams]") {
  Numbers numbers(1'000'000, 1 << 20, kNever);
  std::vector<PointRecord> some(10);
  const auto ahead = read_ahead(numbers);
  CHECK(ahead->next(some) == 10);
}

}  // namespace ptc
