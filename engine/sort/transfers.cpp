// The threads take the next number from one counter, so that transfers begin in ascending order.
#include "engine/sort/transfers.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <vector>

#include "engine/base/background.h"

namespace ptc {

void for_each_transfer(std::size_t count,
                       const std::function<void(std::size_t i, std::size_t worker)>& body) {
  std::atomic<std::size_t> next = 0;
  const auto work = [&](std::size_t worker) {
    for (std::size_t i = next++; i < count; i = next++) body(i, worker);
  };
  std::vector<std::future<void>> others;
  for (std::size_t worker = 1; worker < std::min(kTransfers, count); ++worker) {
    others.push_back(in_background([&work, worker] { work(worker); }));
  }
  work(0);
  for (auto& other : others) other.get();
}

}  // namespace ptc
