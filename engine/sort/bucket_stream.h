// Streams of sorted records, from memory and from buckets on disk.
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
#include "engine/sort/radix_sort.h"
#include "engine/sort/sort_plan.h"
#include "engine/sort/spill.h"

namespace ptc {

/// A stream that has its records in blocks, and copies them into the spans that the caller offers.
class BlockStream : public PointStream {
 public:
  std::size_t next(std::span<PointRecord> out) final;

 protected:
  /// Returns the next block, which stays valid until the next call; empty at the end and in all
  /// later calls.
  virtual std::span<const PointRecord> next_block() = 0;

 private:
  std::span<const PointRecord> block_;
};

/// Loads a partition bucket by bucket, in the order of the keys. A bucket holds the records of one
/// range; one that exceeds the memory is partitioned again.
class BucketLoader {
 public:
  /// @param first                    range to begin with
  /// @param file, executor, leaves  must outlive the loader
  /// @param file                     receives the ranges that are partitioned again
  /// @param leaves                   counts the buckets that were loaded to their end
  BucketLoader(std::shared_ptr<const Partition> partition, std::size_t first, SpillFile& file,
               const SortPlan& plan, const Executor& executor, std::atomic<std::uint32_t>& leaves);

  /// Records of one range: all of them, or a part of a range in which all keys are equal.
  struct Block {
    std::span<PointRecord> records;  ///< empty at the end
    bool sorted = false;             ///< all keys are equal, so no sort is needed
  };

  /// Reads the next records into the front of `out`.
  /// @param scratch  returns memory as long as `out`; called only where a range does not fit and is
  ///                 partitioned again
  /// @throws DataError when kept records are not what was written; std::system_error
  [[nodiscard]] Block read(std::span<PointRecord> out,
                           const std::function<std::span<PointRecord>()>& scratch);

 private:
  void push(std::shared_ptr<const Partition> partition, std::size_t first);
  void split(BucketReader bucket, std::span<PointRecord> out, std::span<PointRecord> scratch);

  SpillFile& file_;
  SpillReader reader_;
  std::size_t ranges_;  ///< ranges that a bucket is cut into when it does not fit
  const Executor& executor_;
  std::atomic<std::uint32_t>& leaves_;
  std::vector<BucketReader> buckets_;  ///< buckets not loaded yet, the next one last; none is empty
};

/// Streams from buckets on disk. While one block is handed out, the next is sorted (if the executor
/// has more than one thread) and the one after it is read:
///
///   memory   | scratch | handed out | being sorted | being read |   four quarters
class BucketStream final : public BlockStream {
 public:
  /// @param memory  the three blocks and the scratch, a quarter each; must outlive the stream
  /// @param at_end  called once, when all records were handed out and the memory is free
  BucketStream(BucketLoader loader, std::span<PointRecord> memory, const Executor& executor,
               std::function<void()> at_end);
  /// Waits for the block that is being loaded.
  ~BucketStream() override;

 private:
  std::span<const PointRecord> next_block() override;
  using Block = BucketLoader::Block;
  void advance(std::span<PointRecord> free);

  BucketLoader loader_;
  const Executor& executor_;
  std::span<PointRecord> current_, scratch_;  ///< current_: handed out, or free before the first
  std::function<void()> at_end_;
  std::exception_ptr error_;
  std::shared_future<Block> sorting_;  ///< declared last, as is reading_: destroying them waits
  std::future<Block> reading_;         ///< for threads that use the other members
};

}  // namespace ptc
