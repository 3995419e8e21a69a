// The plan of an external sort: how it divides the memory that it may hold.
#pragma once

#include <cstddef>
#include <cstdint>

namespace ptc {

/// The smallest number of records whose bytes fill whole pages: 5 pages of 4 KiB.
inline constexpr std::size_t kPageRecords = 512;

/// The sizes of a sort, which follow from the cap and from the number of records expected.
///
/// The memory of two runs is used in three ways, one after another:
///
///   all fits         | records of one run  | scratch of one run  |
///   spilling         | part | part | part | part |    collected, grouped, written at the same time
///   reading buckets  | block | block | block | block |     see BucketStream
struct SortPlan {
  std::size_t run_records = 0;  ///< a multiple of 1024: runs and their halves fill whole pages
  std::size_t ranges = 0;       ///< ranges of keys in a partition
  std::size_t sample_keys = 0;  ///< most keys that are kept for the splitters
  std::size_t read_bytes = 0;   ///< buffer for all reads that run at once
};

/// Returns the bytes that a sort with this plan holds at once: two runs, what grouping and sorting
/// them takes, the sample, and the read buffer. The table of runs comes on top, with 4 bytes for
/// each run and range (12 for kept files): under a cap of 8 MiB or more, 1/6000 of the spilled
/// bytes (1/2000).
[[nodiscard]] std::uint64_t plan_bytes(const SortPlan& plan, unsigned threads) noexcept;

/// Returns the plan with the largest useful runs whose plan_bytes() is at most `memory_bytes`. Runs
/// beyond a certain size are of no use: touching their memory takes longer than the disk, which
/// works at the same time.
/// @param expected  number of records that will come; 0: not known
/// @throws std::invalid_argument when `memory_bytes` is below 256 KiB
[[nodiscard]] SortPlan plan_sort(std::uint64_t memory_bytes, unsigned threads,
                                 std::uint64_t expected);

}  // namespace ptc
