// The memory that radix_sort() allocates next to its scratch, for callers that keep to a cap.
#pragma once

#include <cstddef>

namespace ptc {

/// Returns the most bytes that radix_sort() allocates for this many records and threads.
[[nodiscard]] std::size_t radix_sort_bytes(std::size_t records, unsigned threads) noexcept;

}  // namespace ptc
