// Wall time, CPU time and memory of pieces of work.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "tools/bench/chart/statistics.h"

namespace ptc::bench {

/// The numbers of threads that experiments compare: 1, and `threads` where that is more.
[[nodiscard]] std::vector<unsigned> thread_counts(unsigned threads);

/// Seconds that a piece of work took.
struct Cost {
  double wall = 0;  ///< seconds on the clock
  double cpu = 0;   ///< seconds of all threads together, user and system

  Cost& operator+=(const Cost& other) noexcept;
};

/// Measures the time since it was made.
class Stopwatch {
 public:
  Stopwatch();
  [[nodiscard]] Cost cost() const;

 private:
  Cost start_;
};

/// Calls body(). @return what that took
template <class Body>
[[nodiscard]] Cost timed(const Body& body) {
  const Stopwatch stopwatch;
  body();
  return stopwatch.cost();
}

/// Times of several runs of the same work.
struct Costs {
  std::vector<double> wall, cpu;  ///< seconds

  void add(const Cost& cost);
  /// Wall time in microseconds for each of the `count` items that a run works on.
  [[nodiscard]] Spread wall_us(std::size_t count) const;
  /// CPU time in microseconds for each of the `count` items that a run works on.
  [[nodiscard]] Spread cpu_us(std::size_t count) const;
};

/// Times of the runs of one method, and the maximum of memory that one of them took.
struct TimedRuns : Costs {
  std::uint64_t resident = 0;  ///< maximum of resident bytes during a run, less those before it
  std::uint64_t peak = 0;      ///< maximum of resident bytes of the whole program during a run

  /// Calls body(), and records its time and memory.
  template <class Body>
  void run(const Body& body) {
    const std::uint64_t before = begin();
    add(timed(body));
    end(before);
  }

 private:
  /// Resets the system's record of the peak. @return resident bytes
  [[nodiscard]] static std::uint64_t begin();
  /// Takes the peak since begin() into account. @param resident_before  what begin() returned
  void end(std::uint64_t resident_before);
};

}  // namespace ptc::bench
