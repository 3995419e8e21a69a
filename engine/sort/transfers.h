// Several transfers of a disk at once.
#pragma once

#include <cstddef>
#include <functional>

namespace ptc {

/// A disk gives its full rate to several requests at once.
inline constexpr std::size_t kTransfers = 4;

/// Calls body(i, worker) for every i below `count`, begun in ascending order, in kTransfers threads
/// or as many as there are bodies, one of them the caller's; `worker` < kTransfers is unique among
/// the bodies that run at the same time. What a body throws is thrown when all threads have ended.
void for_each_transfer(std::size_t count,
                       const std::function<void(std::size_t i, std::size_t worker)>& body);

}  // namespace ptc
