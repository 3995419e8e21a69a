// How a sort divides the memory it may hold.
#include "engine/sort/sort_plan.h"

#include <algorithm>
#include <stdexcept>

#include "engine/sort/partition.h"
#include "engine/sort/radix_sort.h"
#include "engine/sort/spill.h"

namespace ptc {
namespace {

constexpr std::uint64_t kLeastBytes = 256 << 10;
constexpr std::uint64_t kMostRecords = 0xffffffff;  // a run's index has 32 bits

// What a run holds of a range is read in one piece: make it worth the disk's while.
constexpr std::uint64_t kPieceBytes = 64 << 10;
constexpr std::size_t kLeastRanges = 48, kMostRanges = 512;
constexpr std::size_t kSampleKeysPerRange = 16;
constexpr std::uint64_t kLeastReadBytes = SpillReader::kLeastBytes, kMostReadBytes = 4 << 20;

// Four parts in two runs, each on a page boundary.
constexpr std::size_t kRunStep = 2 * kPageRecords;
static_assert(kPageRecords * sizeof(PointRecord) % kDirectBytes == 0);

}  // namespace

std::uint64_t plan_bytes(const SortPlan& plan, unsigned threads) noexcept {
  const std::uint64_t runs = 2 * std::uint64_t{plan.run_records} * sizeof(PointRecord);
  // Grouping a run takes less than radix_sort() but for the first block and the numbers of the ranges.
  const std::uint64_t work = radix_sort_bytes(plan.run_records, threads) + partition_bytes(plan.ranges) +
                             plan.run_records * sizeof(std::uint16_t);
  return runs + work + 2 * plan.sample_keys * sizeof(MortonKey) + plan.read_bytes;
}

SortPlan plan_sort(std::uint64_t memory_bytes, unsigned threads) {
  if (memory_bytes < kLeastBytes)
    throw std::invalid_argument("SortOptions::memory_bytes: less than 256 KiB");
  SortPlan plan;
  plan.ranges = static_cast<std::size_t>(
      std::clamp<std::uint64_t>(memory_bytes / 2 / kPieceBytes, kLeastRanges, kMostRanges));
  plan.sample_keys = kSampleKeysPerRange * plan.ranges;

  plan.read_bytes =
      static_cast<std::size_t>(std::clamp(memory_bytes / 64, kLeastReadBytes, kMostReadBytes));

  // plan_bytes() grows with the runs: the largest that stays below the cap.
  std::uint64_t fits = 0;
  std::uint64_t exceeds =
      std::min(memory_bytes / (2 * sizeof(PointRecord)), kMostRecords) / kRunStep + 1;
  while (exceeds - fits > 1) {
    const std::uint64_t steps = fits + (exceeds - fits) / 2;
    plan.run_records = static_cast<std::size_t>(steps * kRunStep);
    (plan_bytes(plan, threads) <= memory_bytes ? fits : exceeds) = steps;
  }
  plan.run_records = static_cast<std::size_t>(fits * kRunStep);
  return plan;
}

}  // namespace ptc
