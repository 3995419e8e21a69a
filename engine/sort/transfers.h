// Runs several disk transfers at the same time.
#pragma once

#include <cstddef>
#include <functional>

namespace ptc {

/// Transfers that run at the same time: a disk reaches its full rate with several requests.
inline constexpr std::size_t kTransfers = 4;

/// Calls body(i, worker) for every i below `count`, beginning them in ascending order, in up to
/// kTransfers threads, one of them the caller's.
/// @param body  may be called concurrently, then with different values of `worker` < kTransfers
/// @throws what a body throws, after all threads have ended
void for_each_transfer(std::size_t count,
                       const std::function<void(std::size_t i, std::size_t worker)>& body);

}  // namespace ptc
