// Records on disk, grouped by range of keys.
#include "engine/sort/spill.h"

#include <algorithm>
#include <cstring>
#include <future>
#include <stdexcept>
#include <utility>

#include "engine/sort/partition.h"

namespace ptc {
namespace {

constexpr std::size_t whole_blocks(std::size_t bytes) noexcept {
  return (bytes + kDirectBytes - 1) / kDirectBytes * kDirectBytes;
}

// The i-th of `count` positions in [0, size), one in each of as many equal strides, anywhere in it:
// records that repeat with a period must not fool the sample. The same for the same arguments.
std::uint64_t sample_position(std::uint64_t i, std::uint64_t count, std::uint64_t size) noexcept {
  const std::uint64_t begin = i * size / count, end = (i + 1) * size / count;
  std::uint64_t mixed = (i + size) * 0x9e3779b97f4a7c15;  // splitmix64 (Steele et al. 2014)
  mixed = (mixed ^ mixed >> 30) * 0xbf58476d1ce4e5b9;
  mixed = (mixed ^ mixed >> 27) * 0x94d049bb133111eb;
  return begin + (mixed ^ mixed >> 31) % (end - begin);
}

}  // namespace

std::uint64_t SpillFile::reserve(std::size_t records) noexcept {
  return end_.fetch_add(whole_blocks(records * sizeof(PointRecord)));
}

void SpillFile::write(std::uint64_t offset, std::span<const PointRecord> records) {
  file_.write_at(offset, {reinterpret_cast<const std::byte*>(records.data()),
                          whole_blocks(records.size_bytes())});
}

void SpillFile::discard(std::uint64_t offset, std::uint64_t bytes) const noexcept {
  const std::uint64_t begin = offset / kDirectBytes * kDirectBytes, end = (offset + bytes) / kDirectBytes * kDirectBytes;
  file_.discard(begin, end - begin);
}

SpillReader::SpillReader(const SpillFile& file, std::size_t buffer_bytes)
    : file_(file), buffer_(buffer_bytes / (kReads * kDirectBytes) * (kReads * kDirectBytes)) {
  if (buffer_.size() < kLeastBytes) throw std::invalid_argument("SpillReader: buffer too small");
}

void SpillReader::read(std::span<const Piece> pieces) {
  const std::size_t share = buffer_.size() / kReads;
  std::atomic<std::size_t> next = 0;
  const auto work = [&](std::size_t reader) {
    const std::span<std::byte> buffer(buffer_.data() + reader * share, share);
    for (std::size_t i = next++; i < pieces.size(); i = next++) read(pieces[i], buffer);
  };
  std::vector<std::future<void>> others;
  for (std::size_t reader = 1; reader < std::min(kReads, pieces.size()); ++reader)
    others.push_back(std::async(std::launch::async, work, reader));
  work(0);
  for (auto& other : others) other.get();
}

void SpillReader::read(const Piece& piece, std::span<std::byte> buffer) const {
  std::uint64_t offset = piece.offset;
  std::span<std::byte> bytes = std::as_writable_bytes(piece.out);
  while (!bytes.empty()) {
    const std::size_t skip = offset % kDirectBytes;  // from the start of the first block
    const std::size_t count = std::min(bytes.size(), buffer.size() - skip);
    file_.file_.read_at(offset - skip, buffer.first(whole_blocks(skip + count)));
    std::memcpy(bytes.data(), buffer.data() + skip, count);
    bytes = bytes.subspan(count);
    offset += count;
  }
}

void SpillReader::take(std::span<const Piece> pieces) {
  read(pieces);
  for (const Piece& piece : pieces) file_.discard(piece.offset, piece.out.size_bytes());
}

Partition::Partition(SpillFile& file, Splitters splitters)
    : file_(file), splitters_(std::move(splitters)) {}

std::uint64_t Partition::add_run(std::span<const PointRecord> records,
                                 std::span<PointRecord> grouped, const Executor& executor) {
  const std::size_t blocks = partition_blocks(records.size(), ranges(), executor.threads());
  // Looking for a range takes longer than keeping its number.
  const auto range_of = std::make_unique_for_overwrite<std::uint16_t[]>(records.size());
  const auto kept = [&](const PointRecord& record) -> std::uint16_t& {
    return range_of[static_cast<std::size_t>(&record - records.data())];
  };
  const auto find = [&](const PointRecord& record) {
    return kept(record) = static_cast<std::uint16_t>(splitters_(record.key));
  };
  const ClassCounts counts(records, ranges(), blocks, find, executor);
  counts.scatter(grouped.data(), kept, executor);
  const std::vector<std::size_t> starts = counts.starts();

  Run& run = runs_.emplace_back();
  run.offset = file_.reserve(records.size());
  run.starts.resize(starts.size());
  std::ranges::transform(starts, run.starts.begin(),
                         [](std::size_t i) { return static_cast<std::uint32_t>(i); });
  return run.offset;
}

BucketReader::BucketReader(std::shared_ptr<const Partition> partition, std::size_t range)
    : partition_(std::move(partition)), range_(range) {
  for (const Partition::Run& run : partition_->runs_) size_ += size_in(run);
  left_ = size_;
}

bool BucketReader::single_key() const noexcept {
  return partition_->splitters_.single_key(range_);
}

std::size_t BucketReader::size_in(const Partition::Run& run) const noexcept {
  return run.starts[range_ + 1] - run.starts[range_];
}

std::uint64_t BucketReader::offset_in(const Partition::Run& run, std::size_t i) const noexcept {
  return run.offset + (run.starts[range_] + i) * sizeof(PointRecord);
}

std::size_t BucketReader::read(std::span<PointRecord> out, SpillReader& reader) {
  std::vector<SpillReader::Piece> pieces;
  std::size_t filled = 0;
  while (filled < out.size() && left_ > 0) {
    const Partition::Run& run = partition_->runs_[run_];
    const std::size_t count = std::min(size_in(run) - at_, out.size() - filled);
    if (count > 0) pieces.push_back({offset_in(run, at_), out.subspan(filled, count)});
    filled += count;
    at_ += count;
    left_ -= count;
    if (at_ == size_in(run)) {
      ++run_;
      at_ = 0;
    }
  }
  reader.take(pieces);
  return filled;
}

std::vector<MortonKey> BucketReader::sample(std::size_t count, SpillReader& reader) const {
  std::vector<PointRecord> records(static_cast<std::size_t>(std::min<std::uint64_t>(count, size_)));
  std::vector<SpillReader::Piece> pieces;
  std::uint64_t begin = 0;  // of the run's part among all records of the range
  for (const Partition::Run& run : partition_->runs_) {
    const std::uint64_t end = begin + size_in(run);
    for (std::size_t i = pieces.size(); i < records.size(); ++i) {
      const std::uint64_t position = sample_position(i, records.size(), size_);
      if (position >= end) break;
      pieces.push_back({offset_in(run, position - begin), {&records[i], 1}});
    }
    begin = end;
  }
  reader.read(pieces);

  std::vector<MortonKey> keys;
  for (const PointRecord& record : records) keys.push_back(record.key);
  return keys;
}

}  // namespace ptc
