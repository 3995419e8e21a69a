// Wall time, CPU time and memory of pieces of work.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "tools/bench/chart/statistics.h"

namespace ptc::bench {

/// One thread, and all of them where there are more.
[[nodiscard]] std::vector<unsigned> thread_counts(unsigned threads);

/// Seconds that something took.
struct Cost {
  double wall = 0;
  double cpu = 0;  ///< of all threads, user and system

  Cost& operator+=(const Cost& other) noexcept;
};

/// Time since it was made.
class Stopwatch {
 public:
  Stopwatch();
  [[nodiscard]] Cost cost() const;

 private:
  Cost start_;
};

template <class Body>
[[nodiscard]] Cost timed(const Body& body) {
  const Stopwatch stopwatch;
  body();
  return stopwatch.cost();
}

/// Times of several runs.
struct Costs {
  std::vector<double> wall, cpu;  ///< seconds

  void add(const Cost& cost);
  /// Microseconds of one of `count` things that each run did.
  [[nodiscard]] Spread wall_us(std::size_t count) const;
  [[nodiscard]] Spread cpu_us(std::size_t count) const;
};

/// Times of the runs of one method, and the most memory that one of them took.
struct TimedRuns : Costs {
  std::uint64_t resident = 0;  ///< most bytes at once during a run, less what was there before it

  /// Calls body() and measures it.
  template <class Body>
  void run(const Body& body) {
    const std::uint64_t before = begin();
    add(timed(body));
    end(before);
  }

 private:
  /// The peak begins anew. @return resident bytes
  [[nodiscard]] static std::uint64_t begin();
  void end(std::uint64_t resident_before);
};

}  // namespace ptc::bench
