// How a sort divides the memory it may hold.
#pragma once

#include <cstddef>
#include <cstdint>

namespace ptc {

/// Fewest records whose bytes are whole pages, 5 of them.
inline constexpr std::size_t kPageRecords = 512;

/// Sizes that follow from the cap and from what will come. Two runs of records are held at once, or
/// four parts of their memory; when buckets are read, it is four blocks.
struct SortPlan {
  std::size_t run_records = 0;  ///< a multiple of 1536: runs and parts lie on page boundaries
  std::size_t ranges = 0;       ///< of a partition
  std::size_t sample_keys = 0;  ///< kept for the splitters, at most
  std::size_t read_bytes = 0;   ///< read from the disk at once
};

/// Bytes held at once by a sort that follows the plan: runs, what grouping and sorting them takes,
/// the sample and what is read at once. The table of runs is beside it, 4 bytes for each run and
/// range, 12 of kept files: 1/6000 of what is spilled, 1/2000, under a cap of 8 MiB or more.
[[nodiscard]] std::uint64_t plan_bytes(const SortPlan& plan, unsigned threads) noexcept;

/// The plan with the largest runs whose plan_bytes() is at most `memory_bytes` and that are of use:
/// touching more memory takes longer than the disk, beside which the sort goes on.
/// @param expected  records; 0: not known
/// @throws std::invalid_argument below 256 KiB
[[nodiscard]] SortPlan plan_sort(std::uint64_t memory_bytes, unsigned threads,
                                 std::uint64_t expected);

}  // namespace ptc
