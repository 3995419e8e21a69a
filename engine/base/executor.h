// Threads: a bounded pool behind one call.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace ptc {

/// Runs loops on a fixed number of threads (oneTBB). The first exception of a body is rethrown by
/// the call; the other bodies of that call are cancelled where they have not begun.
///
/// The calling thread takes part. With one thread, loops run in their caller. Loops may be nested;
/// a body's own loops may run under the same `thread` as the body.
/// Threads: calls may be made concurrently; with one thread each of them has its own `thread` 0.
class Executor {
 public:
  /// @param threads  0: as many as the machine has cores
  explicit Executor(unsigned threads = 0);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  [[nodiscard]] unsigned threads() const noexcept;

  /// Calls body(begin, end) for pieces of [0, count) of at most `grain`, aligned to multiples of
  /// it. Pieces begin in ascending order.
  /// @throws std::invalid_argument when grain is 0
  void for_ranges(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) const;

  /// Calls body(index, thread) for every index in [0, count), begun in ascending order; `thread` <
  /// threads() is unique among the bodies that run at the same time, for per-thread state.
  void for_each(std::size_t count,
                const std::function<void(std::size_t index, unsigned thread)>& body) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
