// Fill memory, spill by range, sort range by range.
#include "engine/sort/external_sort.h"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "engine/base/background.h"
#include "engine/io/file/disk_space.h"
#include "engine/sort/bucket_stream.h"
#include "engine/sort/point_streams.h"
#include "engine/sort/radix_sort.h"

namespace ptc {
namespace {

// All in memory: one block.
class MemoryStream final : public BlockStream {
 public:
  MemoryStream(std::span<const PointRecord> records, std::function<void()> at_end)
      : records_(records), at_end_(std::move(at_end)) {}

 private:
  std::span<const PointRecord> next_block() override {
    if (records_.empty() && at_end_) std::exchange(at_end_, nullptr)();
    return std::exchange(records_, {});
  }

  std::span<const PointRecord> records_;
  std::function<void()> at_end_;
};

}  // namespace

ExternalSorter::ExternalSorter(const SortOptions& options, const Executor& executor,
                               std::span<const MortonKey> sample)
    : options_(options),
      executor_(executor),
      plan_(plan_sort(options.memory_bytes, executor.threads(), options.expected)),
      arena_(2 * plan_.run_records * sizeof(PointRecord)),
      kept_(!options.kept_files.empty()) {
  if (kept_) file_ = SpillFile::named(options.kept_files);
  begin(sample);
  if (expected_spill() == 0) return;
  // Better now than after an hour of partitioning. A little more may be expected than comes.
  require_room(
      options.temp_dirs, expected_spill() / 100 * 95,
      "some " + std::to_string(options.expected) + " points on their way through the sort");
}

ExternalSorter::ExternalSorter(const SortOptions& options, const Executor& executor,
                               StateReader& kept)
    : options_(options), executor_(executor), kept_(true) {
  digest_ = {kept.get<std::uint64_t>(), kept.get<std::uint64_t>()};
  points_ = kept.get<std::uint64_t>();
  plan_ = plan_sort(options.memory_bytes, executor.threads(), points_);
  arena_ = Arena(2 * plan_.run_records * sizeof(PointRecord));
  file_ = SpillFile::reopened(kept);
  partition_ = std::make_shared<Partition>(*file_, kept);
  std::uint64_t found = 0;
  for (std::size_t range = 0; range < partition_->ranges(); ++range)
    found += partition_->size(range);
  kept.require(found == points_, "the temporary files do not hold as many points as were added");
}

// Records that will not fit in memory are spilled from the first part on.
void ExternalSorter::begin(std::span<const MortonKey> sample) {
  sample_.clear();
  const std::size_t stride = sample.size() / plan_.sample_keys + 1;
  for (std::size_t i = 0; i < sample.size(); i += stride) sample_.push_back(sample[i]);
  filling_ = expected_spill() > 0 ? part(0) : memory().first(plan_.run_records);
}

void ExternalSorter::restart(std::uint64_t expected, std::span<const MortonKey> sample) {
  if (!options_.restarts || kept_) throw std::invalid_argument("ExternalSorter::restart");
  grouping_ = {};  // this awaits the end of what goes on, before what it uses goes
  writing_ = {};
  partition_ = nullptr;
  file_.reset();
  options_.expected = expected;
  filled_ = 0;
  points_ = 0;
  digest_ = {};
  finished_ = false;
  buckets_ = 0;
  turn_ = 0;
  begin(sample);
}

void ExternalSorter::release_memory() noexcept {
  if (!options_.restarts) arena_ = Arena();
}

std::span<PointRecord> ExternalSorter::memory() noexcept {
  return {reinterpret_cast<PointRecord*>(arena_.data()), 2 * plan_.run_records};
}

std::span<PointRecord> ExternalSorter::scratch() noexcept {
  return memory().last(plan_.run_records);
}

std::span<PointRecord> ExternalSorter::part(std::size_t k) noexcept {
  return memory().subspan(k * part_records(), part_records());
}

// Where there is a partition: the ranges of records of the first run.
std::span<std::uint16_t> ExternalSorter::ranges_of(std::span<const PointRecord> records) noexcept {
  return std::span(range_of_).subspan(static_cast<std::size_t>(records.data() - memory().data()),
                                      records.size());
}

std::uint64_t ExternalSorter::expected_spill() const noexcept {
  const bool spills = options_.expected > plan_.run_records || kept_;
  return spills ? options_.expected * record_bytes() : 0;
}

void ExternalSorter::add(std::span<const PointRecord> records) {
  if (finished_) throw std::invalid_argument("ExternalSorter::add after finish");
  points_ += records.size();
  while (!records.empty()) {
    if (filled_ == filling_.size()) spill();
    const std::size_t count = std::min(records.size(), filling_.size() - filled_);
    take(records.first(count));
    records = records.subspan(count);
  }
}

// Does everything that looks at a record while it is in the processor's cache; when the records
// are grouped they have left it.
void ExternalSorter::take(std::span<const PointRecord> records) {
  constexpr std::size_t kGrain = 1 << 14, kInCache = 1 << 9;
  const std::span<PointRecord> to = filling_.subspan(filled_, records.size());
  std::vector<RecordsDigest> digests(records.size() / kGrain + 1);
  executor_.for_ranges(records.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t at = begin; at < end; at += kInCache) {
      const auto some = records.subspan(at, std::min(kInCache, end - at));
      digests[begin / kGrain] = sum(digests[begin / kGrain], digest_of(some));
      if (partition_) partition_->find_ranges(some, ranges_of(to.subspan(at, some.size())));
      std::ranges::copy(some, to.begin() + static_cast<std::ptrdiff_t>(at));
    }
  });
  for (const RecordsDigest& part : digests) digest_ = sum(digest_, part);
  filled_ += records.size();
}

// Chooses the ranges. Without a sample, the first run stands for what will come.
void ExternalSorter::begin_partition() {
  constexpr std::size_t kKeysPerRange = 4, kMinKeys = 64;
  if (sample_.size() < kMinKeys) {
    sample_.clear();
    const std::size_t stride = filled_ / plan_.sample_keys + 1;
    for (std::size_t i = 0; i < filled_; i += stride) sample_.push_back(filling_[i].key);
  }
  const std::size_t ranges =
      std::clamp<std::size_t>(sample_.size() / kKeysPerRange, 3, plan_.ranges);
  if (sample_.empty()) sample_.emplace_back();  // no record came, and the files are kept
  if (!file_) file_.emplace(options_.temp_dirs);
  partition_ = std::make_shared<Partition>(*file_, Splitters(std::move(sample_), ranges), kept_,
                                           record_bytes());
  sample_ = {};
  range_of_.resize(plan_.run_records);
  partition_->find_ranges(filling_.first(filled_), ranges_of(filling_.first(filled_)), executor_);
}

// Groups the filled part while another is filled, and writes the grouped one while that is grouped.
void ExternalSorter::spill() {
  if (!partition_) begin_partition();
  if (grouping_.valid()) grouping_.get();  // it reads the part that is filled next
  const std::span<PointRecord> records = filling_.first(filled_);
  // The first run is whole where it was not known that more would come.
  const bool whole_run = filling_.size() > part_records();
  const auto grouped = std::as_writable_bytes(whole_run ? scratch() : part(2 + turn_));
  auto group = [this, records, grouped, free = writing_[turn_]] {
    if (free.valid()) free.get();
    return partition_->group_run(records, ranges_of(records), grouped, executor_);
  };
  const bool at_once = whole_run || executor_.threads() == 1;
  grouping_ = at_once ? std::async(std::launch::deferred, std::move(group)).share()
                      : in_background(std::move(group)).share();
  if (at_once) grouping_.get();
  // Direct writes leave the processor free: another thread, even if the executor has only one.
  writing_[turn_] =
      in_background([this, grouped, grouping = grouping_, before = writing_[1 - turn_]] {
        if (before.valid()) before.get();
        partition_->write_run(grouped, grouping.get());
      }).share();
  if (whole_run) writing_[1 - turn_] = writing_[turn_];
  turn_ = 1 - turn_;
  filling_ = whole_run || filling_.data() != part(0).data() ? part(0) : part(1);
  filled_ = 0;
}

std::unique_ptr<PointStream> ExternalSorter::stream_memory() {
  const std::span<PointRecord> records = memory().first(filled_);
  radix_sort(records, scratch(), executor_);
  if (!options_.restarts) {
    const std::size_t bytes = plan_.run_records * sizeof(PointRecord);
    arena_.discard(bytes, bytes);
  }
  buckets_ = 1;
  return std::make_unique<MemoryStream>(records, [this] { release_memory(); });
}

void ExternalSorter::spill_all() {
  if (!partition_) begin_partition();
  if (filled_ > 0) spill();
  for (const auto& write : writing_) {
    if (write.valid()) write.get();
  }
  range_of_ = {};
}

void ExternalSorter::keep(StateWriter& state) {
  spill_all();
  state.put(digest_[0]);
  state.put(digest_[1]);
  state.put(points_);
  file_->save(state);
  partition_->save(state);
}

void ExternalSorter::discard_before(std::uint64_t record) {
  for (; discarded_ < partition_->ranges(); ++discarded_) {
    const std::uint64_t end = discarded_points_ + partition_->size(discarded_);
    if (end > record) return;
    partition_->discard(discarded_);
    discarded_points_ = end;
  }
}

std::unique_ptr<PointStream> ExternalSorter::stream_buckets(std::uint64_t first) {
  if (kept_) nested_.emplace(options_.temp_dirs);
  std::size_t range = 0;
  for (; range < partition_->ranges() && partition_->size(range) <= first; ++range)
    first -= partition_->size(range);
  auto stream = std::make_unique<BucketStream>(
      BucketLoader(partition_, range, kept_ ? *nested_ : *file_, plan_, executor_, buckets_),
      memory(), executor_, [this] { release_memory(); });
  pass_over(*stream, first);
  return stream;
}

std::unique_ptr<PointStream> ExternalSorter::finish(std::uint64_t first) {
  if (std::exchange(finished_, true))
    throw std::invalid_argument("ExternalSorter::finish called twice");
  if (!partition_ && !kept_) return stream_memory();
  spill_all();
  return stream_buckets(first);
}

SortStatistics ExternalSorter::statistics() const noexcept {
  const auto bytes_of = [](const std::optional<SpillFile>& file) {
    return file ? file->bytes() : 0;
  };
  return {points_, bytes_of(file_) + bytes_of(nested_), buckets_};
}

}  // namespace ptc
