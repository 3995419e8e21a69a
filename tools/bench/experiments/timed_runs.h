// Wall time, CPU time and memory of runs.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <vector>

namespace ptc::bench {

/// One thread, and all of them where there are more.
[[nodiscard]] std::vector<unsigned> thread_counts(unsigned threads);

/// Times of the runs of one method, and the most memory that one of them took.
struct TimedRuns {
  std::vector<double> wall, cpu;  ///< seconds; CPU of all threads, user and system
  std::uint64_t resident = 0;  ///< most bytes at once during a run, less what was there before it

  /// Calls body() and measures it.
  template <class Body>
  void run(const Body& body) {
    const Start start = begin();
    body();
    end(start);
  }

 private:
  struct Start {
    std::chrono::steady_clock::time_point wall;
    double cpu = 0;
    std::uint64_t resident = 0;
  };
  [[nodiscard]] static Start begin();
  void end(const Start& start);
};

}  // namespace ptc::bench
