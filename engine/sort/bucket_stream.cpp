// Buckets from disk, one loaded ahead of the one that is handed out.
#include "engine/sort/bucket_stream.h"

#include <algorithm>
#include <utility>
#include <vector>

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
    BucketReader& bucket = buckets_.back();
    if (bucket.left() > out.size() && !bucket.single_key()) {
      BucketReader large = std::move(bucket);
      buckets_.pop_back();
      split(std::move(large), out, scratch());
      continue;
    }
    // All that is kept of it must be found whole before a piece of it goes out.
    if (bucket.kept() && bucket.left() == bucket.size() && bucket.left() > out.size()) {
      for (BucketReader ahead = bucket; ahead.read(out, reader_) > 0;) continue;
    }
    // Records of one key are sorted as they came: they are the input's order.
    const Block block{out.first(bucket.read(out, reader_)), bucket.single_key()};
    if (bucket.left() == 0) {
      buckets_.pop_back();
      ++leaves_;
    }
    return block;
  }
  return {};
}

// A bucket that does not fit: a partition of its own, whose ranges come in its place. It ends,
// because Splitters cut off at least the records of one key, which fit always.
void BucketLoader::split(BucketReader bucket, std::span<PointRecord> out,
                         std::span<PointRecord> scratch) {
  constexpr std::size_t kSamplesPerRange = 4;  // each is a read of its own
  Splitters splitters(bucket.sample(kSamplesPerRange * ranges_, reader_), ranges_);
  const auto partition = std::make_shared<Partition>(file_, std::move(splitters));
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
  scratch_ = block(0);  // on a page boundary, for it is written where a range is partitioned again
  reading_ = std::async(std::launch::async, [this, out = block(1)] {
    return loader_.read(out, [this] { return scratch_; });
  });
  advance(block(2));
  current_ = block(3);
}

BucketStream::~BucketStream() = default;

// What was read is sorted, and more is read. Reading leaves the processor free: it has a thread
// even if the executor has only one.
void BucketStream::advance(std::span<PointRecord> free) {
  const Block read = reading_.get();
  const auto sort = [this, read] {
    if (!read.sorted && !read.records.empty()) radix_sort(read.records, scratch_, executor_);
    return read;
  };
  sorting_ = std::async(executor_.threads() == 1 ? std::launch::deferred : std::launch::async, sort)
                 .share();
  if (read.records.empty()) return;
  const auto scratch = [this, sorting = sorting_] {
    sorting.wait();
    return scratch_;
  };
  reading_ =
      std::async(std::launch::async, [this, free, scratch] { return loader_.read(free, scratch); });
}

std::span<const PointRecord> BucketStream::next_block() {
  if (error_) std::rethrow_exception(error_);  // what failed once has no next block
  if (!sorting_.valid()) return {};
  try {
    const std::span<PointRecord> sorted = sorting_.get().records;
    if (sorted.empty()) {
      sorting_ = {};
      at_end_();
      return {};
    }
    advance(current_);  // which the caller has no more use for
    current_ = {sorted.data(), scratch_.size()};
    return sorted;
  } catch (...) {
    error_ = std::current_exception();
    throw;
  }
}

}  // namespace ptc
