// Loads buckets from disk ahead of the one that is handed out: read one, sort it while the next is
// read, hand it out.
#include "engine/sort/bucket_stream.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "engine/base/background.h"
#include "engine/sort/radix_sort.h"

namespace ptc {
std::size_t BlockStream::next(std::span<PointRecord> out) {
  std::size_t filled = 0;
  while (filled < out.size()) {
    if (block_.empty() && (block_ = next_block()).empty()) break;
    const std::size_t count = std::min(out.size() - filled, block_.size());
    std::ranges::copy(block_.first(count), out.begin() + static_cast<std::ptrdiff_t>(filled));
    block_ = block_.subspan(count);
    filled += count;
  }
  return filled;
}

BucketLoader::BucketLoader(std::shared_ptr<const Partition> partition, std::size_t first,
                           SpillFile& file, const SortPlan& plan, const Executor& executor,
                           std::atomic<std::uint32_t>& leaves)
    : file_(file),
      reader_(plan.read_bytes),
      ranges_(plan.ranges),
      executor_(executor),
      leaves_(leaves) {
  push(std::move(partition), first);
}

void BucketLoader::push(std::shared_ptr<const Partition> partition, std::size_t first) {
  for (std::size_t range = partition->ranges(); range-- > first;) {
    BucketReader bucket(partition, range);
    if (bucket.size() > 0) buckets_.push_back(std::move(bucket));
  }
}

BucketLoader::Block BucketLoader::read(std::span<PointRecord> out,
                                       const std::function<std::span<PointRecord>()>& scratch) {
  while (!buckets_.empty()) {
    // Partition a bucket that does not fit again, and go on with its first range.
    BucketReader& bucket = buckets_.back();
    if (bucket.left() > out.size() && !bucket.single_key()) {
      BucketReader large = std::move(bucket);
      buckets_.pop_back();
      split(std::move(large), out, scratch());
      continue;
    }
    // Check all records of a kept bucket before a part of it goes out.
    if (bucket.kept() && bucket.left() == bucket.size() && bucket.left() > out.size()) {
      for (BucketReader ahead = bucket; ahead.read(out, reader_) > 0;) continue;
    }
    // Read it. Records of one key are sorted as they are, because they lie in the input's order.
    const Block block{out.first(bucket.read(out, reader_)), bucket.single_key()};
    if (bucket.left() == 0) {
      buckets_.pop_back();
      ++leaves_;
    }
    return block;
  }
  return {};
}

// Partitions a bucket that does not fit, and puts the new ranges in its place. The recursion ends,
// because Splitters give the records of at least one key a range of their own, and a range with one
// key need not fit.
void BucketLoader::split(BucketReader bucket, std::span<PointRecord> out,
                         std::span<PointRecord> scratch) {
  // Choose new ranges from a sample of the bucket.
  constexpr std::size_t kSamplesPerRange = 4;  // few, because each sample is a read of its own
  Splitters splitters(bucket.sample(kSamplesPerRange * ranges_, reader_), ranges_);
  const auto partition =
      std::make_shared<Partition>(file_, std::move(splitters), false, bucket.record_bytes());
  // Write the bucket's records again, run by run, grouped by the new ranges.
  std::vector<std::uint16_t> range_of(out.size());
  while (const std::size_t count = bucket.read(out, reader_)) {
    const std::span<const PointRecord> run = out.first(count);
    const auto grouped = std::as_writable_bytes(scratch);
    partition->find_ranges(run, range_of, executor_);
    partition->write_run(grouped, partition->group_run(run, range_of, grouped, executor_));
  }
  push(partition, 0);
}

BucketStream::BucketStream(BucketLoader loader, std::span<PointRecord> memory,
                           const Executor& executor, std::function<void()> at_end)
    : loader_(std::move(loader)), executor_(executor), at_end_(std::move(at_end)) {
  const std::size_t quarter = memory.size() / 4;
  const auto block = [&](std::size_t k) { return memory.subspan(k * quarter, quarter); };
  scratch_ = block(0);  // begins on a page boundary: a range that is partitioned again is written
                        // to disk from here
  reading_ = in_background(
      [this, out = block(1)] { return loader_.read(out, [this] { return scratch_; }); });
  advance(block(2));
  current_ = block(3);
}

BucketStream::~BucketStream() = default;

// Begins to sort the block that was read, and to read the next one into `free`. Reading hardly uses
// the processor, so it has its own thread even if the executor has only one.
void BucketStream::advance(std::span<PointRecord> free) {
  const Block read = reading_.get();
  const auto sort = [this, read] {
    if (!read.sorted && !read.records.empty()) radix_sort(read.records, scratch_, executor_);
    return read;
  };
  sorting_ = executor_.threads() == 1 ? std::async(std::launch::deferred, sort).share()
                                      : in_background(sort).share();
  if (read.records.empty()) return;
  const auto scratch = [this, sorting = sorting_] {
    sorting.wait();
    return scratch_;
  };
  reading_ = in_background([this, free, scratch] { return loader_.read(free, scratch); });
}

std::span<const PointRecord> BucketStream::next_block() {
  if (error_) std::rethrow_exception(error_);  // a stream that failed stays failed
  if (!sorting_.valid()) return {};
  try {
    const std::span<PointRecord> sorted = sorting_.get().records;
    if (sorted.empty()) {
      sorting_ = {};
      at_end_();
      return {};
    }
    advance(current_);  // the caller is done with this block
    current_ = {sorted.data(), scratch_.size()};
    return sorted;
  } catch (...) {
    error_ = std::current_exception();
    throw;
  }
}

}  // namespace ptc
