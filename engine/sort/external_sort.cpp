// External Morton sort: fill memory, spill by range, sort range by range.
#include "engine/sort/external_sort.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "engine/base/memory.h"
#include "engine/io/file/disk_space.h"
#include "engine/sort/bucket_stream.h"
#include "engine/sort/radix_sort.h"
#include "engine/sort/sort_plan.h"
#include "engine/sort/spill.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr std::uint64_t kPassed = 1 << 14;  // records that are passed over at once
using Digest = std::array<std::uint64_t, 2>;

Digest sum(const Digest& a, const Digest& b) noexcept {
  return {a[0] + b[0], a[1] + b[1]};
}

Digest digest_of(std::span<const PointRecord> records) noexcept {
  return xxh3_128_sum(std::as_bytes(records), sizeof(PointRecord));
}

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

void pass_over(PointStream& points, std::uint64_t count) {
  std::vector<PointRecord> passed(
      static_cast<std::size_t>(std::min<std::uint64_t>(count, kPassed)));
  while (count > 0) {
    const auto most = static_cast<std::size_t>(std::min<std::uint64_t>(count, passed.size()));
    const std::size_t now = points.next(std::span(passed).first(most));
    if (now == 0) return;
    count -= now;
  }
}

struct ExternalSorter::Impl {
  Impl(const SortOptions& sort_options, const Executor& sort_executor,
       std::span<const MortonKey> given_sample)
      : options(sort_options),
        executor(sort_executor),
        plan(plan_sort(options.memory_bytes, executor.threads(), options.expected)),
        arena(2 * plan.run_records * sizeof(PointRecord)),
        kept(!options.kept_files.empty()) {
    if (kept) file = SpillFile::named(options.kept_files);
    const std::size_t stride = given_sample.size() / plan.sample_keys + 1;
    for (std::size_t i = 0; i < given_sample.size(); i += stride) sample.push_back(given_sample[i]);
    const bool will_spill = expected_spill() > 0;
    filling = will_spill ? part(0) : memory().first(plan.run_records);
    if (!will_spill) return;
    // Better now than after an hour of partitioning. What is expected may be a little more than
    // comes.
    require_room(
        options.temp_dirs, expected_spill() / 100 * 95,
        "some " + std::to_string(options.expected) + " points on their way through the sort");
  }

  Impl(const SortOptions& sort_options, const Executor& sort_executor, StateReader& state)
      : options(sort_options), executor(sort_executor), kept(true) {
    digest = {state.get<std::uint64_t>(), state.get<std::uint64_t>()};
    points = state.get<std::uint64_t>();
    plan = plan_sort(options.memory_bytes, executor.threads(), points);
    arena = Arena(2 * plan.run_records * sizeof(PointRecord));
    file = SpillFile::reopened(state);
    partition = std::make_shared<Partition>(*file, state);
    std::uint64_t found = 0;
    for (std::size_t range = 0; range < partition->ranges(); ++range)
      found += partition->size(range);
    state.require(found == points, "the temporary files do not hold as many points as were added");
  }

  [[nodiscard]] std::span<PointRecord> memory() noexcept {
    return {reinterpret_cast<PointRecord*>(arena.data()), 2 * plan.run_records};
  }
  [[nodiscard]] std::uint64_t expected_spill() const noexcept {
    const bool spills = options.expected > plan.run_records || kept;
    return spills ? options.expected * kSpilledBytes : 0;
  }
  [[nodiscard]] std::span<PointRecord> scratch() noexcept {
    return memory().last(plan.run_records);
  }

  void add(std::span<const PointRecord> records);
  void take(std::span<const PointRecord> records);
  void begin_partition();
  void spill();
  void spill_all();
  void keep(StateWriter& state);
  void discard_before(std::uint64_t record);
  /// Memory in four: while one part is filled, another is grouped into the third, and the fourth is
  /// written.
  [[nodiscard]] std::span<PointRecord> part(std::size_t k) noexcept {
    return memory().subspan(k * part_records(), part_records());
  }
  [[nodiscard]] std::size_t part_records() noexcept { return memory().size() / 4; }
  /// Where there is a partition: the ranges of records of the first run.
  [[nodiscard]] std::span<std::uint16_t> ranges_of(std::span<const PointRecord> records) noexcept {
    return std::span(range_of).subspan(static_cast<std::size_t>(records.data() - memory().data()),
                                       records.size());
  }
  [[nodiscard]] std::unique_ptr<PointStream> stream_memory();
  [[nodiscard]] std::unique_ptr<PointStream> stream_buckets(std::uint64_t first);

  SortOptions options;
  const Executor& executor;
  SortPlan plan;
  std::vector<MortonKey> sample;
  Arena arena;                          // two runs
  std::span<PointRecord> filling;       // a run, or a part() once it is known that not all will fit
  std::size_t filled = 0;               // records there
  std::vector<std::uint16_t> range_of;  // see ranges_of()
  bool kept = false;                    // files have names, and stay
  std::uint64_t points = 0;
  Digest digest{};
  bool finished = false;
  std::optional<SpillFile> file;  // from the first spill on, or with kept files
  std::shared_ptr<Partition> partition;
  std::optional<SpillFile>
      nested;  // for buckets of kept files that are partitioned again: nobody needs them later
  std::size_t discarded = 0;           // ranges, of kept files
  std::uint64_t discarded_points = 0;  // there
  std::atomic<std::uint32_t> buckets{0};
  std::size_t turn = 0;  // which of two parts is grouped into next
  // Of what was filled before, and of what was grouped into either part; last, so that they are
  // waited for first.
  std::shared_future<Partition::Starts> grouping;
  std::array<std::shared_future<void>, 2> writing;
};

void ExternalSorter::Impl::add(std::span<const PointRecord> records) {
  points += records.size();
  while (!records.empty()) {
    if (filled == filling.size()) spill();
    const std::size_t count = std::min(records.size(), filling.size() - filled);
    take(records.first(count));
    records = records.subspan(count);
  }
}

// All that looks at a record does so while it is in the cache: before it is grouped it has left it.
void ExternalSorter::Impl::take(std::span<const PointRecord> records) {
  constexpr std::size_t kGrain = 1 << 14, kInCache = 1 << 9;
  const std::span<PointRecord> to = filling.subspan(filled, records.size());
  std::vector<Digest> digests(records.size() / kGrain + 1);
  executor.for_ranges(records.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t at = begin; at < end; at += kInCache) {
      const auto some = records.subspan(at, std::min(kInCache, end - at));
      digests[begin / kGrain] = sum(digests[begin / kGrain], digest_of(some));
      if (partition) partition->find_ranges(some, ranges_of(to.subspan(at, some.size())));
      std::ranges::copy(some, to.begin() + static_cast<std::ptrdiff_t>(at));
    }
  });
  for (const Digest& part : digests) digest = sum(digest, part);
  filled += records.size();
}

// Only the first run is known: without a sample it stands for what will come.
void ExternalSorter::Impl::begin_partition() {
  constexpr std::size_t kKeysPerRange = 4, kMinKeys = 64;
  if (sample.size() < kMinKeys) {
    sample.clear();
    const std::size_t stride = filled / plan.sample_keys + 1;
    for (std::size_t i = 0; i < filled; i += stride) sample.push_back(filling[i].key);
  }
  const std::size_t ranges = std::clamp<std::size_t>(sample.size() / kKeysPerRange, 3, plan.ranges);
  if (sample.empty()) sample.emplace_back();  // of nothing that is to be kept
  if (!file) file.emplace(options.temp_dirs);
  partition = std::make_shared<Partition>(*file, Splitters(std::move(sample), ranges), kept);
  sample = {};
  range_of.resize(plan.run_records);
  partition->find_ranges(filling.first(filled), ranges_of(filling.first(filled)), executor);
}

// Groups what was filled while more is filled, and writes it while that is grouped.
void ExternalSorter::Impl::spill() {
  if (!partition) begin_partition();
  if (grouping.valid()) grouping.wait();  // out of the part that is filled next
  const std::span<PointRecord> records = filling.first(filled);
  const bool whole_run =
      filling.size() >
      part_records();  // the first one, where it was not known that more would come
  const auto grouped = std::as_writable_bytes(whole_run ? scratch() : part(2 + turn));
  const auto group = [this, records, grouped, free = writing[turn]] {
    if (free.valid()) free.get();
    return partition->group_run(records, ranges_of(records), grouped, executor);
  };
  const bool at_once = whole_run || executor.threads() == 1;
  grouping = std::async(at_once ? std::launch::deferred : std::launch::async, group).share();
  if (at_once) grouping.wait();
  // Direct writes leave the processor free: another thread, even if the executor has only one.
  writing[turn] = std::async(std::launch::async, [this, grouped, grouping = grouping,
                                                  before = writing[1 - turn]] {
                    if (before.valid()) before.get();
                    partition->write_run(grouped, grouping.get());
                  }).share();
  if (whole_run) writing[1 - turn] = writing[turn];
  turn = 1 - turn;
  filling = whole_run || filling.data() != part(0).data() ? part(0) : part(1);
  filled = 0;
}

std::unique_ptr<PointStream> ExternalSorter::Impl::stream_memory() {
  const std::span<PointRecord> records = memory().first(filled);
  radix_sort(records, scratch(), executor);
  arena.discard(plan.run_records * sizeof(PointRecord), plan.run_records * sizeof(PointRecord));
  buckets = 1;
  return std::make_unique<MemoryStream>(records, [this] { arena = Arena(); });
}

void ExternalSorter::Impl::spill_all() {
  if (!partition) begin_partition();
  if (filled > 0) spill();
  for (const auto& write : writing) {
    if (write.valid()) write.get();
  }
  range_of = {};
}

void ExternalSorter::Impl::keep(StateWriter& state) {
  spill_all();
  state.put(digest[0]);
  state.put(digest[1]);
  state.put(points);
  file->save(state);
  partition->save(state);
}

void ExternalSorter::Impl::discard_before(std::uint64_t record) {
  for (; discarded < partition->ranges(); ++discarded) {
    const std::uint64_t end = discarded_points + partition->size(discarded);
    if (end > record) return;
    partition->discard(discarded);
    discarded_points = end;
  }
}

std::unique_ptr<PointStream> ExternalSorter::Impl::stream_buckets(std::uint64_t first) {
  if (kept) nested.emplace(options.temp_dirs);
  std::size_t range = 0;
  for (; range < partition->ranges() && partition->size(range) <= first; ++range)
    first -= partition->size(range);
  auto stream = std::make_unique<BucketStream>(
      BucketLoader(partition, range, kept ? *nested : *file, plan, executor, buckets), memory(),
      executor, [this] { arena = Arena(); });
  pass_over(*stream, first);
  return stream;
}

ExternalSorter::ExternalSorter(const SortOptions& options, const Executor& executor,
                               std::span<const MortonKey> sample)
    : impl_(std::make_unique<Impl>(options, executor, sample)) {}

ExternalSorter::ExternalSorter(const SortOptions& options, const Executor& executor,
                               StateReader& kept)
    : impl_(std::make_unique<Impl>(options, executor, kept)) {}

ExternalSorter::~ExternalSorter() = default;

std::uint64_t ExternalSorter::expected_spill() const noexcept {
  return impl_->expected_spill();
}

void ExternalSorter::add(std::span<const PointRecord> records) {
  if (impl_->finished) throw std::invalid_argument("ExternalSorter::add after finish");
  impl_->add(records);
}

std::array<std::uint64_t, 2> ExternalSorter::digest() const noexcept {
  return impl_->digest;
}

void ExternalSorter::keep(StateWriter& state) {
  impl_->keep(state);
}

void ExternalSorter::discard_before(std::uint64_t record) {
  impl_->discard_before(record);
}

std::unique_ptr<PointStream> ExternalSorter::finish(std::uint64_t first) {
  if (std::exchange(impl_->finished, true))
    throw std::invalid_argument("ExternalSorter::finish called twice");
  if (!impl_->partition && !impl_->kept) return impl_->stream_memory();
  impl_->spill_all();
  return impl_->stream_buckets(first);
}

SortStatistics ExternalSorter::statistics() const noexcept {
  const auto bytes_of = [](const std::optional<SpillFile>& file) {
    return file ? file->bytes() : 0;
  };
  return {impl_->points, bytes_of(impl_->file) + bytes_of(impl_->nested), impl_->buckets};
}

}  // namespace ptc
