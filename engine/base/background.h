/// Work that goes on beside the caller.
#pragma once

#include <chrono>
#include <future>
#include <memory>
#include <utility>

namespace ptc {

/// Begins `work` on a thread of its own. Where the system starts no thread for this process, for
/// want of memory or by its limit, the work is done at once.
template <class Work>
[[nodiscard]] auto in_background(Work work) {
  // GCC's async() tries a thread with what it was given, and again without one: a callable that it
  // may move from would be empty the second time.
  const auto task = [work = std::make_shared<Work>(std::move(work))] { return (*work)(); };
  auto result = std::async(std::launch::async | std::launch::deferred, task);
  if (result.wait_for(std::chrono::seconds(0)) == std::future_status::deferred) result.wait();
  return result;
}

}  // namespace ptc
