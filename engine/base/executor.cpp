// Loops over a pool: who takes which index, and what happens when a body throws.
#include "engine/base/executor.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>

#include "engine/base/pool.h"

namespace ptc {
namespace {

using Body = std::function<void(std::size_t index, unsigned thread)>;

// One call of for_each: every worker takes the next index until none is left, so bodies begin in
// ascending order, which is the order in which the data lies on the disk.
class Loop final : public Pool::Work {
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

}  // namespace

struct Executor::Impl {
  explicit Impl(unsigned count) : threads(count) {
    if (threads > 1) pool.emplace(threads);
  }

  unsigned threads;
  std::optional<Pool> pool;  // none: loops run in their caller
};

Executor::Executor(unsigned threads)
    : impl_(std::make_unique<Impl>(threads == 0 ? std::max(1u, std::thread::hardware_concurrency())
                                                : threads)) {}

Executor::~Executor() = default;

unsigned Executor::threads() const noexcept {
  return impl_->threads;
}

void Executor::for_each(std::size_t count, const Body& body) const {
  if (count == 0) return;
  if (!impl_->pool) {
    for (std::size_t i = 0; i < count; ++i) body(i, 0);
    return;
  }
  Loop loop(count, body);
  const auto workers = static_cast<unsigned>(std::min<std::size_t>(count, impl_->threads));
  impl_->pool->run(workers, loop);
  loop.rethrow();
}

void Executor::for_ranges(
    std::size_t count, std::size_t grain,
    const std::function<void(std::size_t begin, std::size_t end)>& body) const {
  if (grain == 0) throw std::invalid_argument("Executor::for_ranges: grain is 0");
  const std::size_t pieces = count / grain + (count % grain != 0);
  for_each(pieces, [&](std::size_t piece, unsigned) {
    const std::size_t begin = piece * grain;
    body(begin, begin + std::min(grain, count - begin));
  });
}

}  // namespace ptc

#if defined(__SANITIZE_THREAD__)
// TBB clears its own memory by calls the race checker intercepts, without seeing their order.
extern "C" const char* __tsan_default_suppressions() {
  return "called_from_lib:libtbb.so\n";
}
#endif
