// Buckets from disk, one loaded ahead of the one that is handed out.
#include "engine/sort/bucket_stream.h"

#include <algorithm>
#include <utility>

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

BucketLoader::BucketLoader(std::shared_ptr<const Partition> partition, SpillFile& file,
                           const SortPlan& plan, const Executor& executor,
                           std::atomic<std::uint32_t>& leaves)
    : file_(file),
      reader_(file, plan.read_bytes),
      ranges_(plan.ranges),
      executor_(executor),
      leaves_(leaves) {
  push(std::move(partition));
}

void BucketLoader::push(std::shared_ptr<const Partition> partition) {
  for (std::size_t range = partition->ranges(); range-- > 0;) {
    BucketReader bucket(partition, range);
    if (bucket.size() > 0) buckets_.push_back(std::move(bucket));
  }
}

std::size_t BucketLoader::load(std::span<PointRecord> out, std::span<PointRecord> scratch) {
  while (!buckets_.empty()) {
    BucketReader& bucket = buckets_.back();
    if (bucket.left() > out.size() && !bucket.single_key()) {
      BucketReader large = std::move(bucket);
      buckets_.pop_back();
      split(std::move(large), out, scratch);
      continue;
    }
    const std::span<PointRecord> records = out.first(bucket.read(out, reader_));
    // Records of one key are sorted as they came: they are the input's order.
    if (!bucket.single_key()) radix_sort(records, scratch, executor_);
    if (bucket.left() == 0) {
      buckets_.pop_back();
      ++leaves_;
    }
    return records.size();
  }
  return 0;
}

// A bucket that does not fit: a partition of its own, whose ranges come in its place. It ends,
// because Splitters cut off at least the records of one key, which fit always.
void BucketLoader::split(BucketReader bucket, std::span<PointRecord> out,
                         std::span<PointRecord> scratch) {
  constexpr std::size_t kSamplesPerRange = 4;  // each is a read of its own
  Splitters splitters(bucket.sample(kSamplesPerRange * ranges_, reader_), ranges_);
  const auto partition = std::make_shared<Partition>(file_, std::move(splitters));
  while (const std::size_t count = bucket.read(out, reader_)) {
    const std::span<PointRecord> run = out.first(count), grouped = scratch.first(count);
    const std::uint64_t offset = partition->add_run(run, grouped, executor_);
    file_.write(offset, grouped);
  }
  push(partition);
}

BucketStream::BucketStream(BucketLoader loader, std::span<PointRecord> memory, std::launch policy,
                           std::function<void()> at_end)
    : loader_(std::move(loader)), policy_(policy), at_end_(std::move(at_end)) {
  const std::size_t third = memory.size() / 3;
  current_ = memory.subspan(0, third);
  ahead_ = memory.subspan(third, third);
  scratch_ = memory.subspan(2 * third, third);
  load_ahead();
}

BucketStream::~BucketStream() = default;

void BucketStream::load_ahead() {
  loading_ = std::async(policy_, [this] { return loader_.load(ahead_, scratch_); });
}

std::span<const PointRecord> BucketStream::next_block() {
  if (error_) std::rethrow_exception(error_);  // what failed once has no next block
  if (!loading_.valid()) return {};
  try {
    const std::size_t count = loading_.get();
    if (count == 0) {
      at_end_();
      return {};
    }
    std::swap(current_, ahead_);
    load_ahead();
    return current_.first(count);
  } catch (...) {
    error_ = std::current_exception();
    throw;
  }
}

}  // namespace ptc
