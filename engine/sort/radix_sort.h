// What the radix sort allocates beside its scratch, for those who keep to a cap.
#pragma once

#include <cstddef>

namespace ptc {

/// Bytes that radix_sort() allocates at most for so many records and threads.
[[nodiscard]] std::size_t radix_sort_bytes(std::size_t records, unsigned threads) noexcept;

}  // namespace ptc
