// The executor that this library brings.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "engine/base/executor.h"

namespace ptc {

/// A bounded pool of threads (oneTBB). With one thread, loops run in their caller.
class ThreadPool final : public Executor {
 public:
  /// The maximum number of threads.
  static constexpr unsigned kMaxThreads = 4096;

  /// @param threads  0: one for each core of the machine; at most kMaxThreads
  /// @throws RequestError that names `run.threads` for more
  /// @throws std::system_error when the system allows fewer threads
  explicit ThreadPool(unsigned threads = 0);
  ~ThreadPool() override;

  /// Returns the number of threads of a pool that is made with `threads`.
  /// @throws RequestError as the constructor does
  [[nodiscard]] static unsigned count(unsigned threads);

  [[nodiscard]] unsigned threads() const noexcept override { return threads_; }
  void for_each(std::size_t count,
                const std::function<void(std::size_t index, unsigned thread)>& body) const override;

 private:
  unsigned threads_;
  std::unique_ptr<class TbbArena> arena_;  ///< null with one thread
};

}  // namespace ptc
