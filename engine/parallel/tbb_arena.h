// Threads from oneTBB. Only tbb_arena.cpp knows the library.
#pragma once

#include <memory>

namespace ptc {

/// An arena with one slot per thread, the calling thread's among them.
class TbbArena {
 public:
  /// @param threads  at least 1
  explicit TbbArena(unsigned threads);
  ~TbbArena();
  TbbArena(const TbbArena&) = delete;
  TbbArena& operator=(const TbbArena&) = delete;

  /// What run() calls.
  class Work {
   public:
    virtual void work(unsigned slot) noexcept = 0;

   protected:
    ~Work() = default;
  };

  /// Calls work.work(slot) `times` times, each on whichever thread of the arena is free; `slot` is
  /// below the number of threads and differs between calls that run at the same time. A thread that
  /// waits in run() takes no work of an enclosing run(), which would come under the same slot.
  void run(unsigned times, Work& work);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
