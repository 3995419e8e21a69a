// Parallel loops, whoever brings the threads.
#pragma once

#include <cstddef>
#include <functional>

namespace ptc {

/// Runs loops on a fixed number of threads. ThreadPool is the one that this library brings; a
/// program with threads of its own may implement it over those.
///
/// The first exception of a body is rethrown by the call; bodies of that call that have not begun
/// are skipped. The calling thread takes part. Loops may be nested: a body's own loops may run
/// under the same `thread` as the body. Threads: calls may be made concurrently; with one thread
/// each of them has its own `thread` 0.
class Executor {
 public:
  Executor() = default;
  virtual ~Executor() = default;
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  /// The number of threads, the caller's included; at least 1.
  [[nodiscard]] virtual unsigned threads() const noexcept = 0;

  /// Calls body(index, thread) for every index in [0, count). Bodies begin in ascending order.
  /// `thread` < threads() is unique among the bodies that run at the same time, so it can choose
  /// per-thread state.
  virtual void for_each(
      std::size_t count,
      const std::function<void(std::size_t index, unsigned thread)>& body) const = 0;

  /// Calls body(begin, end) for the pieces of [0, count) between multiples of `grain`. Pieces begin
  /// in ascending order.
  /// @throws std::invalid_argument when grain is 0
  void for_ranges(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) const;
};

}  // namespace ptc
