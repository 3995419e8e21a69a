// Records on disk, grouped by range of keys.
#include "engine/sort/spill.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <future>
#include <numeric>
#include <stdexcept>
#include <system_error>
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

/// A disk, a quota or what the file system allows a file is used up: another directory may have room.
bool is_full(const std::error_code& code) noexcept {
  return code.value() == ENOSPC || code.value() == EDQUOT || code.value() == EFBIG;
}

}  // namespace

SpillFile::SpillFile(std::span<const std::filesystem::path> directories) {
  for (const std::filesystem::path& directory : directories) volumes_.push_back(std::make_unique<Volume>(directory));
}

std::vector<std::uint32_t> SpillFile::by_room(std::uint64_t bytes) const {
  std::vector<double> fill;
  for (const auto& volume : volumes_) {
    std::error_code unknown;  // a write tells what is wrong
    const std::uint64_t free = std::filesystem::space(volume->directory, unknown).available;
    const auto used = static_cast<double>(volume->end + bytes);
    fill.push_back(unknown ? used : used / (static_cast<double>(volume->end) + static_cast<double>(free) + 1.0));
  }
  std::vector<std::uint32_t> order(volumes_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, {}, [&](std::uint32_t v) { return fill[v]; });
  return order;
}

SpillPlace SpillFile::append(std::span<const PointRecord> records) {
  const std::span bytes(reinterpret_cast<const std::byte*>(records.data()), whole_blocks(records.size_bytes()));
  const std::vector<std::uint32_t> order = by_room(bytes.size());
  for (const std::uint32_t v : order) {
    Volume& volume = *volumes_[v];
    const SpillPlace place{v, volume.end};
    try {
      volume.file.write_at(place.offset, bytes);
    } catch (const std::system_error& error) {
      if (v == order.back() || !is_full(error.code())) throw;
      volume.file.discard(place.offset, bytes.size());  // the part that found room
      continue;
    }
    volume.end += bytes.size();
    return place;
  }
  throw std::invalid_argument("SpillFile: no directory");
}

void SpillFile::read_at(const SpillPlace& place, std::span<std::byte> bytes) const {
  volumes_[place.volume]->file.read_at(place.offset, bytes);
}

void SpillFile::discard(const SpillPlace& place, std::uint64_t bytes) const noexcept {
  const std::uint64_t begin = place.offset / kDirectBytes * kDirectBytes;
  const std::uint64_t end = (place.offset + bytes) / kDirectBytes * kDirectBytes;
  volumes_[place.volume]->file.discard(begin, end - begin);
}

std::uint64_t SpillFile::bytes() const noexcept {
  std::uint64_t bytes = 0;
  for (const auto& volume : volumes_) bytes += volume->end;
  return bytes;
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
  SpillPlace place = piece.place;
  std::span<std::byte> bytes = std::as_writable_bytes(piece.out);
  while (!bytes.empty()) {
    const std::size_t skip = place.offset % kDirectBytes;  // from the start of the first block
    const std::size_t count = std::min(bytes.size(), buffer.size() - skip);
    file_.read_at({place.volume, place.offset - skip}, buffer.first(whole_blocks(skip + count)));
    std::memcpy(bytes.data(), buffer.data() + skip, count);
    bytes = bytes.subspan(count);
    place.offset += count;
  }
}

void SpillReader::take(std::span<const Piece> pieces) {
  read(pieces);
  for (const Piece& piece : pieces) file_.discard(piece.place, piece.out.size_bytes());
}

Partition::Partition(SpillFile& file, Splitters splitters)
    : file_(file), splitters_(std::move(splitters)) {}

void Partition::add_run(std::span<const PointRecord> records, std::span<PointRecord> grouped, const Executor& executor) {
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
  run.starts.resize(starts.size());
  std::ranges::transform(starts, run.starts.begin(),
                         [](std::size_t i) { return static_cast<std::uint32_t>(i); });
}

void Partition::write_run(std::span<const PointRecord> grouped) { runs_.back().place = file_.append(grouped); }

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

SpillPlace BucketReader::place_in(const Partition::Run& run, std::size_t i) const noexcept {
  return {run.place.volume, run.place.offset + (run.starts[range_] + i) * sizeof(PointRecord)};
}

std::size_t BucketReader::read(std::span<PointRecord> out, SpillReader& reader) {
  std::vector<SpillReader::Piece> pieces;
  std::size_t filled = 0;
  while (filled < out.size() && left_ > 0) {
    const Partition::Run& run = partition_->runs_[run_];
    const std::size_t count = std::min(size_in(run) - at_, out.size() - filled);
    if (count > 0) pieces.push_back({place_in(run, at_), out.subspan(filled, count)});
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
      pieces.push_back({place_in(run, position - begin), {&records[i], 1}});
    }
    begin = end;
  }
  reader.read(pieces);

  std::vector<MortonKey> keys;
  for (const PointRecord& record : records) keys.push_back(record.key);
  return keys;
}

}  // namespace ptc
