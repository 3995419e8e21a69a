// Time and memory of pieces of work (tools/bench/references/timed_runs.h).
#include "tools/bench/references/timed_runs.h"

#include <cstdint>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/memory.h"

namespace ptc::bench {

TEST_CASE("timed runs: the peak counts the whole program, the other maximum what a run adds",
          "[bench]") {
  constexpr std::uint64_t kMiB = 1 << 20;
  const std::vector<char> held(64 * kMiB, 1);
  TimedRuns runs;
  for (const std::uint64_t more : {std::uint64_t{8}, std::uint64_t{32}, std::uint64_t{16}}) {
    const std::uint64_t before = resident_bytes();
    runs.run([&] {
      const std::vector<char> added(more * kMiB, 1);
      CHECK(added.back() == 1);
    });
    CHECK(runs.peak > before);
  }
  CHECK(runs.wall.size() == 3);
  CHECK(runs.peak >= (64 + 32) * kMiB);
  CHECK(runs.resident >= 31 * kMiB);
  CHECK(runs.resident < 64 * kMiB);
  CHECK(held.back() == 1);
}

}  // namespace ptc::bench
