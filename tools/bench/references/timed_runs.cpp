#include "tools/bench/references/timed_runs.h"

#include <algorithm>
#include <chrono>
#include <fstream>

#include "engine/base/memory.h"

namespace ptc::bench {
namespace {

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

std::vector<unsigned> thread_counts(unsigned threads) {
  if (threads == 1) return {1};
  return {1, threads};
}

Cost& Cost::operator+=(const Cost& other) noexcept {
  wall += other.wall;
  cpu += other.cpu;
  return *this;
}

Stopwatch::Stopwatch() : start_{.wall = wall_seconds(), .cpu = cpu_seconds()} {}

Cost Stopwatch::cost() const {
  return {.wall = wall_seconds() - start_.wall, .cpu = cpu_seconds() - start_.cpu};
}

void Costs::add(const Cost& cost) {
  wall.push_back(cost.wall);
  cpu.push_back(cost.cpu);
}

Spread Costs::wall_us(std::size_t count) const {
  return scaled(spread_of(wall), 1e6 / static_cast<double>(count));
}

Spread Costs::cpu_us(std::size_t count) const {
  return scaled(spread_of(cpu), 1e6 / static_cast<double>(count));
}

std::uint64_t TimedRuns::begin() {
  return_freed_memory();
  // "5" resets the peak (Linux, proc(5)). Where the system does not allow this, the peak is that of
  // all runs so far.
  std::ofstream("/proc/self/clear_refs") << "5";
  return resident_bytes();
}

void TimedRuns::end(std::uint64_t resident_before) {
  const std::uint64_t now = peak_resident_bytes();
  resident = std::max(resident, now - std::min(now, resident_before));
  peak = std::max(peak, now);
}

}  // namespace ptc::bench
