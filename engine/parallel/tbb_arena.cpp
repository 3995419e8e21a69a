// Threads from oneTBB. Compiled without the race checker, which does not see how the library orders
// its tasks and would report them all; ThreadPool orders what its bodies read and write by itself.
#include "engine/parallel/tbb_arena.h"

#include <optional>
#include <thread>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

namespace ptc {

struct TbbArena::Impl {
  explicit Impl(unsigned threads) : arena(static_cast<int>(threads), 1) {
    // TBB starts no more workers than the machine has cores unless it is told to.
    if (threads > std::thread::hardware_concurrency())
      more.emplace(tbb::global_control::max_allowed_parallelism, threads);
  }

  tbb::task_arena arena;
  std::optional<tbb::global_control> more;
};

TbbArena::TbbArena(unsigned threads) : impl_(std::make_unique<Impl>(threads)) {}

TbbArena::~TbbArena() = default;

void TbbArena::run(unsigned times, Work& work) {
  const auto one = [&work](const tbb::blocked_range<unsigned>&) {
    work.work(static_cast<unsigned>(tbb::this_task_arena::current_thread_index()));
  };
  impl_->arena.execute([&] {
    tbb::this_task_arena::isolate([&] {
      tbb::parallel_for(tbb::blocked_range<unsigned>(0, times, 1), one, tbb::simple_partitioner());
    });
  });
}

}  // namespace ptc
