// Sorted records out of memory and out of buckets on disk.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/memory.h"
#include "engine/sort/external_sort.h"
#include "engine/sort/sort_plan.h"
#include "engine/sort/spill.h"

namespace ptc {

/// Hands out blocks of sorted records, copied into what the caller offers.
class BlockStream : public PointStream {
 public:
  std::size_t next(std::span<PointRecord> out) final;

 protected:
  /// The next block, valid until the next call; empty at the end, and from then on.
  virtual std::span<const PointRecord> next_block() = 0;

 private:
  std::span<const PointRecord> block_;
};

/// Loads a partition bucket by bucket, in the order of the keys.
class BucketLoader {
 public:
  /// @param first   range to begin with
  /// @param file    for ranges that are partitioned again
  /// @param leaves  counts the buckets that were loaded
  BucketLoader(std::shared_ptr<const Partition> partition, std::size_t first, SpillFile& file,
               const SortPlan& plan, const Executor& executor, std::atomic<std::uint32_t>& leaves);

  /// Records of one range, all of it unless their keys are equal.
  struct Block {
    std::span<PointRecord> records;  ///< none at the end
    bool sorted = false;             ///< by their equal keys
  };

  /// Reads the next records into the front of `out`.
  /// @param scratch  as long as `out`; called where a range does not fit and is partitioned again
  [[nodiscard]] Block read(std::span<PointRecord> out,
                           const std::function<std::span<PointRecord>()>& scratch);

 private:
  void push(std::shared_ptr<const Partition> partition, std::size_t first);
  void split(BucketReader bucket, std::span<PointRecord> out, std::span<PointRecord> scratch);

  SpillFile& file_;
  SpillReader reader_;
  std::size_t ranges_;  // into how many a bucket is cut that does not fit
  const Executor& executor_;
  std::atomic<std::uint32_t>& leaves_;
  std::vector<BucketReader> buckets_;  // not loaded yet, the next one last; none is empty
};

/// Streams from buckets on disk. While one block is handed out the next is sorted, if the executor
/// has more than one thread, and the one after it read.
class BucketStream final : public BlockStream {
 public:
  /// @param memory  given back at the end; its quarters are the three blocks and the scratch
  BucketStream(BucketLoader loader, std::span<PointRecord> memory, const Executor& executor,
               std::function<void()> at_end);
  /// Waits for a block being loaded.
  ~BucketStream() override;

 private:
  std::span<const PointRecord> next_block() override;
  using Block = BucketLoader::Block;
  void advance(std::span<PointRecord> free);

  BucketLoader loader_;
  const Executor& executor_;
  std::span<PointRecord> current_, scratch_;  ///< current: handed out, or free at first
  std::function<void()> at_end_;
  std::exception_ptr error_;
  std::shared_future<Block> sorting_;  // these two last, so that they are waited for first
  std::future<Block> reading_;
};

}  // namespace ptc
