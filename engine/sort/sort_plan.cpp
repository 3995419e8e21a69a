// Chooses the ranges first, then the sample and the read buffer, and gives the rest to the runs.
#include "engine/sort/sort_plan.h"

#include <algorithm>
#include <stdexcept>

#include "engine/sort/partition.h"
#include "engine/sort/radix_sort.h"
#include "engine/sort/spill.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMinBytes = 256 << 10;
constexpr std::uint64_t kMaxRecords = 0xffffffff;  // record numbers within a run have 32 bits

// The records of one range in one run are read in one piece, which should be at least this long.
constexpr std::uint64_t kPieceBytes = 64 << 10;
constexpr std::uint64_t kMinRanges = 48, kUsualRanges = 512, kMaxRanges = 2048;
// Sample keys for each range. The more there are, the less ranges differ in size: with the most, by
// an eighth (standard deviation).
constexpr std::uint64_t kMinSampleKeys = 16, kMaxSampleKeys = 64;
constexpr std::uint64_t kMinReadBytes = SpillReader::kMinBytes, kMaxReadBytes = 4 << 20;

// Two runs hold four parts, each of which begins on a page boundary.
constexpr std::size_t kRunStep = 2 * kPageRecords;
static_assert(kPageRecords * sizeof(PointRecord) % kDirectBytes == 0);

// A part of 94 MB holds a piece of each range that is long enough, and where there are few ranges a
// smaller one does: memory that is touched for the first time takes longer than the disk.
constexpr std::uint64_t kPartRecords = kPageRecords * 4608;
constexpr std::uint64_t kUsualPieceBytes = 1 << 20;

// Each range becomes one bucket. Smaller buckets are sorted faster, but grouping by more ranges and
// reading more pieces takes longer, which sets the minimum. The maximum lets a bucket fit into a
// quarter of the memory although ranges differ in size.
constexpr std::uint64_t kMinRangeRecords = 5 << 16, kMaxRangeRecords = kPartRecords / 8 * 5;

}  // namespace

std::uint64_t plan_bytes(const SortPlan& plan, unsigned threads) noexcept {
  const std::uint64_t runs = 2 * std::uint64_t{plan.run_records} * sizeof(PointRecord);
  // Grouping a run takes no more than radix_sort(), except for the bursts of a single block and the
  // range numbers of the records.
  const std::uint64_t work = radix_sort_bytes(plan.run_records, threads) +
                             partition_bytes(plan.ranges) +
                             plan.run_records * sizeof(std::uint16_t);
  return runs + work + 2 * plan.sample_keys * sizeof(MortonKey) + plan.read_bytes;
}

SortPlan plan_sort(std::uint64_t memory_bytes, unsigned threads, std::uint64_t expected) {
  if (memory_bytes < kMinBytes)
    throw std::invalid_argument("SortOptions::memory_bytes: less than 256 KiB");
  // Choose as many ranges as give buckets of a useful size and pieces that are long enough.
  SortPlan plan;
  const std::uint64_t usual =
      expected == 0 ? kUsualRanges
                    : std::clamp(expected / kMinRangeRecords, kMinRanges, kUsualRanges);
  const std::uint64_t wanted = std::clamp(expected / kMaxRangeRecords + 1, usual, kMaxRanges);
  plan.ranges =
      static_cast<std::size_t>(std::clamp(memory_bytes / 2 / kPieceBytes, kMinRanges, wanted));
  // Give the sample and the read buffer a 64th of the memory each.
  const std::uint64_t keys_of_cap = memory_bytes / 64 / sizeof(MortonKey) / plan.ranges;
  plan.sample_keys =
      static_cast<std::size_t>(std::clamp(keys_of_cap, kMinSampleKeys, kMaxSampleKeys)) *
      plan.ranges;

  plan.read_bytes =
      static_cast<std::size_t>(std::clamp(memory_bytes / 64, kMinReadBytes, kMaxReadBytes));

  // Find the largest useful runs within the cap by bisection, as plan_bytes() grows with the runs.
  const std::uint64_t part =
      expected <= 2 * kPartRecords  // all fits, or it is not known what comes
          ? kPartRecords
          : std::min(kPartRecords, plan.ranges * kUsualPieceBytes / sizeof(PointRecord));
  const std::uint64_t of_use = 2 * std::max(part, expected / plan.ranges * 8 / 5);
  std::uint64_t fits = 0;
  std::uint64_t exceeds =
      std::min({memory_bytes / (2 * sizeof(PointRecord)), of_use, kMaxRecords}) / kRunStep + 1;
  while (exceeds - fits > 1) {
    const std::uint64_t steps = fits + (exceeds - fits) / 2;
    plan.run_records = static_cast<std::size_t>(steps * kRunStep);
    (plan_bytes(plan, threads) <= memory_bytes ? fits : exceeds) = steps;
  }
  plan.run_records = static_cast<std::size_t>(fits * kRunStep);
  return plan;
}

}  // namespace ptc
