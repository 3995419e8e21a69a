#include "tools/bench/experiments/timed_runs.h"

#include <fstream>

#include "engine/base/memory.h"

namespace ptc::bench {

std::vector<unsigned> thread_counts(unsigned threads) {
  if (threads == 1) return {1};
  return {1, threads};
}

TimedRuns::Start TimedRuns::begin() {
  return_freed_memory();
  std::ofstream("/proc/self/clear_refs")
      << "5";  // the peak begins anew; where that is not allowed, it is that of all so far
  return {
      .wall = std::chrono::steady_clock::now(), .cpu = cpu_seconds(), .resident = resident_bytes()};
}

void TimedRuns::end(const Start& start) {
  wall.push_back(
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start.wall).count());
  cpu.push_back(cpu_seconds() - start.cpu);
  const std::uint64_t peak = peak_resident_bytes();
  resident = std::max(resident, peak - std::min(peak, start.resident));
}

}  // namespace ptc::bench
