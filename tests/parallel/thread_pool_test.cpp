// Parallel loops on a bounded pool of threads.
#include "engine/parallel/thread_pool.h"

#include <atomic>
#include <chrono>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"

using namespace ptc;

namespace {

constexpr unsigned kThreadCounts[] = {1, 2, 3, 8};

// Waits long enough for the other threads to arrive.
void linger() {
  std::this_thread::sleep_for(std::chrono::microseconds(200));
}

}  // namespace

TEST_CASE("executor: it has as many threads as requested, or as the machine has cores",
          "[base][executor]") {
  for (const unsigned threads : kThreadCounts) CHECK(ThreadPool(threads).threads() == threads);
  CHECK(ThreadPool(0).threads() >= 1);
}

TEST_CASE("executor: every index is visited exactly once", "[base][executor]") {
  for (const unsigned threads : kThreadCounts) {
    const ThreadPool executor(threads);
    for (const std::size_t count : {0u, 1u, 2u, 7u, 1000u}) {
      std::vector<std::atomic<int>> visits(count);
      executor.for_each(count, [&](std::size_t i, unsigned) { ++visits[i]; });
      for (const auto& n : visits) CHECK(n == 1);
    }
  }
}

TEST_CASE("executor: ranges are the aligned pieces of the count", "[base][executor]") {
  for (const unsigned threads : {1u, 2u}) {
    const ThreadPool executor(threads);
    for (std::size_t count = 0; count < 12; ++count)
      for (std::size_t grain = 1; grain < 14; ++grain) {
        std::vector<std::size_t> end_of(count + 1, 0);
        executor.for_ranges(count, grain,
                            [&](std::size_t begin, std::size_t end) { end_of[begin] = end; });
        for (std::size_t i = 0; i < count; ++i)
          CHECK(end_of[i] == (i % grain == 0 ? std::min(i + grain, count) : 0));
      }
    CHECK_THROWS_AS(executor.for_ranges(1, 0, [](std::size_t, std::size_t) {}),
                    std::invalid_argument);
    std::size_t pieces = 0;  // begin + grain would overflow
    executor.for_ranges(10, SIZE_MAX, [&](std::size_t, std::size_t end) { pieces += end; });
    CHECK(pieces == 10);
  }
}

TEST_CASE("executor: a thread index is in range and never used twice at a time",
          "[base][executor]") {
  for (const unsigned threads : kThreadCounts) {
    const ThreadPool executor(threads);
    std::vector<std::atomic<int>> busy(threads);
    std::atomic<int> clashes = 0, most = 0, running = 0;
    executor.for_each(64, [&](std::size_t, unsigned thread) {
      if (thread >= threads || busy[thread].exchange(1) != 0) ++clashes;
      const int now = ++running;
      for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
      }
      linger();
      // On a loaded machine the second thread may be late: wait for it, at most 10 s.
      for (int i = 0; threads > 1 && most < 2 && i < 10'000; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      --running;
      if (thread < threads) busy[thread] = 0;
    });
    CHECK(clashes == 0);
    CHECK(most <= static_cast<int>(threads));
    if (threads > 1) CHECK(most > 1);
  }
}

TEST_CASE("executor: a nested loop keeps its thread's index and runs no outer body meanwhile",
          "[base][executor]") {
  for (const unsigned threads : kThreadCounts) {
    const ThreadPool executor(threads);
    std::vector<std::atomic<int>> busy(threads);
    std::atomic<int> clashes = 0, inner = 0;
    executor.for_each(32, [&](std::size_t, unsigned thread) {
      if (busy[thread].exchange(1) != 0) ++clashes;
      executor.for_each(8, [&](std::size_t, unsigned nested) {
        if (nested >= threads) ++clashes;
        ++inner;
        linger();
      });
      busy[thread] = 0;
    });
    CHECK(clashes == 0);
    CHECK(inner == 32 * 8);
  }
}

TEST_CASE("executor: concurrent calls from the caller's own threads neither deadlock nor mix",
          "[base][executor]") {
  const ThreadPool executor(2);
  std::vector<std::thread> users;
  std::atomic<std::size_t> sum = 0;
  for (int u = 0; u < 4; ++u)
    users.emplace_back([&] {
      for (int repeat = 0; repeat < 50; ++repeat)
        executor.for_each(10, [&](std::size_t i, unsigned) { sum += i; });
    });
  for (std::thread& user : users) user.join();
  CHECK(sum == 4 * 50 * 45);
}

TEST_CASE("executor: the exception of a body reaches the caller and stops the loop",
          "[base][executor]") {
  for (const unsigned threads : kThreadCounts) {
    const ThreadPool executor(threads);
    std::atomic<std::size_t> begun = 0;
    const auto fail_at = [&](std::size_t bad) {
      executor.for_each(100000, [&, bad](std::size_t i, unsigned) {
        ++begun;
        if (i == bad) throw std::runtime_error("body " + std::to_string(bad));
        if (i > bad) linger();
      });
    };
    CHECK_THROWS_WITH(fail_at(17), "body 17");
    CHECK(begun >= 18);
    CHECK(begun < 50000);
    CHECK_THROWS_AS(executor.for_each(1, [](std::size_t, unsigned) { throw 1; }), int);

    std::atomic<int> after = 0;  // the executor can be used again
    executor.for_each(10, [&](std::size_t, unsigned) { ++after; });
    CHECK(after == 10);
  }
}

TEST_CASE("executor: an exception passes through nested loops", "[base][executor]") {
  for (const unsigned threads : kThreadCounts) {
    const ThreadPool executor(threads);
    CHECK_THROWS_WITH(executor.for_each(8,
                                        [&](std::size_t, unsigned) {
                                          executor.for_ranges(100, 3, [](std::size_t, std::size_t) {
                                            throw std::runtime_error("inner");
                                          });
                                        }),
                      "inner");
  }
}

TEST_CASE("executor: the caller sees everything that the bodies wrote", "[base][executor]") {
  for (const unsigned threads : kThreadCounts) {
    const ThreadPool executor(threads);
    std::vector<int> values(5000, 0);
    for (int round = 0; round < 20; ++round)
      executor.for_ranges(values.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) values[i] += static_cast<int>(i);
      });
    bool all = true;
    for (std::size_t i = 0; i < values.size(); ++i)
      all = all && values[i] == 20 * static_cast<int>(i);
    CHECK(all);
  }
}

TEST_CASE("thread pool: more threads than any machine has are refused", "[parallel]") {
  CHECK_THROWS_AS(ThreadPool(ThreadPool::kMaxThreads + 1), RequestError);
  CHECK_THROWS_AS(ThreadPool(~0U), RequestError);
}
