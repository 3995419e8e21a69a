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
  /// @param leaves  counts the buckets that were loaded
  BucketLoader(std::shared_ptr<const Partition> partition, SpillFile& file, const SortPlan& plan,
               const Executor& executor, std::atomic<std::uint32_t>& leaves);

  /// Fills the front of `out` with the next sorted records. @return how many; 0 at the end
  /// @param scratch  as long as `out`
  [[nodiscard]] std::size_t load(std::span<PointRecord> out, std::span<PointRecord> scratch);

 private:
  void push(std::shared_ptr<const Partition> partition);
  void split(BucketReader bucket, std::span<PointRecord> out, std::span<PointRecord> scratch);

  SpillFile& file_;
  SpillReader reader_;
  std::size_t ranges_;  // into how many a bucket is cut that does not fit
  const Executor& executor_;
  std::atomic<std::uint32_t>& leaves_;
  std::vector<BucketReader> buckets_;  // not loaded yet, the next one last; none is empty
};

/// Streams from buckets on disk. While one block is handed out the next one is loaded on another
/// thread, if the executor has more than one.
class BucketStream final : public BlockStream {
 public:
  /// @param memory  given back at the end; its three thirds are the two blocks and the scratch
  BucketStream(BucketLoader loader, std::span<PointRecord> memory, std::launch policy,
               std::function<void()> at_end);
  /// Waits for a block being loaded.
  ~BucketStream() override;

 private:
  std::span<const PointRecord> next_block() override;
  void load_ahead();

  BucketLoader loader_;
  std::span<PointRecord> current_, ahead_, scratch_;
  std::launch policy_;
  std::function<void()> at_end_;
  std::exception_ptr error_;
  std::future<std::size_t> loading_;  // into ahead_; last, so that it is waited for first
};

}  // namespace ptc
