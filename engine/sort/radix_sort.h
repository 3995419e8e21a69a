// The sort in memory: stable, by all bits of the key.
#pragma once

#include <cstddef>
#include <span>

#include "engine/base/executor.h"
#include "format/point_record.h"

namespace ptc {

/// Sorts records by key in memory; stable, all 128 bits of a key count. MSD radix sort, insertion
/// sort for small pieces. Time: linear for keys that are spread evenly, at worst one pass for each
/// bit of a key.
/// @param scratch  at least as many records as `records`; its content is undefined afterwards
/// @throws std::invalid_argument when the scratch is smaller; std::bad_alloc
void radix_sort(std::span<PointRecord> records, std::span<PointRecord> scratch,
                const Executor& executor);

/// Returns the most bytes that radix_sort() allocates, next to its scratch, for this many records
/// and threads.
[[nodiscard]] std::size_t radix_sort_bytes(std::size_t records, unsigned threads) noexcept;

}  // namespace ptc
