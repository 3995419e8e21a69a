// Which thread of the pool takes which index, and what happens when a body throws.
#include "engine/parallel/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <latch>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "engine/base/error.h"
#include "engine/parallel/tbb_arena.h"

namespace ptc {
namespace {

using Body = std::function<void(std::size_t index, unsigned thread)>;

// One call of for_each: every worker takes the next index until none is left, so bodies begin in
// ascending order, which is the order in which the data lies on the disk.
class Loop final : public TbbArena::Work {
 public:
  // The release here and the acquire in work() let the bodies see what the caller wrote; those on
  // finished_ let the caller see what the bodies wrote.
  Loop(std::size_t count, const Body& body) : count_(count), body_(body) {
    ready_.store(true, std::memory_order_release);
  }

  void work(unsigned slot) noexcept override {
    ready_.load(std::memory_order_acquire);
    try {
      for (std::size_t i = take(); i < count_; i = take()) body_(i, slot);
    } catch (...) {
      stop(std::current_exception());
    }
    finished_.fetch_add(1, std::memory_order_release);
  }

  void rethrow() {
    finished_.load(std::memory_order_acquire);
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::size_t take() noexcept {
    if (stopped_.load(std::memory_order_relaxed)) return count_;
    return next_.fetch_add(1, std::memory_order_relaxed);
  }

  void stop(std::exception_ptr error) noexcept {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = std::move(error);
    stopped_.store(true, std::memory_order_relaxed);
  }

  const std::size_t count_;
  const Body& body_;
  std::atomic<std::size_t> next_{0};
  std::atomic<bool> ready_{false};
  std::atomic<unsigned> finished_{0};
  std::atomic<bool> stopped_{false};
  std::mutex mutex_;
  std::exception_ptr error_;  // the first one
};

// Throws std::system_error when the system does not let this process have that many more threads.
// oneTBB starts its threads later, inside itself, and ends the program when one cannot be started.
void require_threads(unsigned threads) {
  std::latch over(1);
  std::vector<std::thread> started;
  const auto join = [&] {
    over.count_down();
    for (std::thread& thread : started) thread.join();
  };
  try {
    started.reserve(threads);
    while (started.size() < threads) started.emplace_back([&] { over.wait(); });
  } catch (const std::system_error& error) {
    const std::size_t count = started.size();
    join();
    throw std::system_error(error.code(), "starting " + std::to_string(threads) +
                                              " threads, of which only " + std::to_string(count) +
                                              " fit the memory or the limit that the system sets");
  }
  join();
}

}  // namespace

unsigned ThreadPool::count(unsigned threads) {
  require_request(threads <= kMaxThreads, "run.threads", "`run.threads` is not 0 to 4096");
  return threads == 0 ? std::max(1U, std::thread::hardware_concurrency()) : threads;
}

ThreadPool::ThreadPool(unsigned threads) : threads_(count(threads)) {
  if (threads_ == 1) return;
  require_threads(threads_ - 1);
  arena_ = std::make_unique<TbbArena>(threads_);
}

ThreadPool::~ThreadPool() = default;

void ThreadPool::for_each(std::size_t count, const Body& body) const {
  if (count == 0) return;
  if (!arena_) {
    for (std::size_t i = 0; i < count; ++i) body(i, 0);
    return;
  }
  Loop loop(count, body);
  arena_->run(static_cast<unsigned>(std::min<std::size_t>(count, threads_)), loop);
  loop.rethrow();
}

}  // namespace ptc

#if defined(__SANITIZE_THREAD__)
// TBB clears its own memory by calls the race checker intercepts, without seeing their order.
extern "C" const char* __tsan_default_suppressions() {
  return "called_from_lib:libtbb.so\n";
}
#endif
