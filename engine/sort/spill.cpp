// Transfers between memory, where records have 40 bytes and begin anywhere, and disk, where they
// are packed and transfers move whole blocks:
//
//   memory   | record . | record . | record . |      .: reserved bytes, not on disk
//   disk     ...|record|record|record|....
//            |  block  |  block  |  block  |         a read takes the blocks around its records
#include "engine/sort/spill.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "engine/base/error.h"
#include "engine/base/numbers.h"
#include "engine/io/file/file.h"
#include "engine/sort/partition.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMaxVolumes = 1 << 10;
constexpr std::size_t kWriteBytes = std::size_t{2} << 20;  // written by one call

// The i-th of `count` sample positions in [0, size). There is one in each of `count` equal strides,
// at a pseudorandom place in it, so that records that repeat with a period do not mislead the
// sample. Equal arguments give equal positions.
std::uint64_t sample_position(std::uint64_t i, std::uint64_t count, std::uint64_t size) noexcept {
  const std::uint64_t begin = i * size / count, end = (i + 1) * size / count;
  return begin + splitmix64((i + size - 1) * kSplitMixStep) % (end - begin);
}

/// Returns whether an error means that a disk, a quota or the size limit of a file is used up, so
/// that another directory may still have room.
bool is_full(const std::error_code& code) noexcept {
  return code.value() == ENOSPC || code.value() == EDQUOT || code.value() == EFBIG;
}

/// Returns the checksum of the spilled bytes of records i, i+1, ... of one run's range. The
/// checksums of consecutive pieces add up to the checksum of the whole range.
/// @param bytes   spilled bytes of a record
/// @param stride  bytes from one record to the next
std::uint64_t digest_of(std::span<const std::byte> records, std::size_t bytes, std::size_t stride,
                        std::uint64_t i) noexcept {
  return xxh3_64_sum(records, bytes, stride, i);
}

/// Restores records from their spilled bytes.
template <std::size_t kBytes>
void unpack(const std::byte* bytes, std::span<PointRecord> out) noexcept {
  for (std::size_t i = 0; i < out.size(); ++i) {
    PointRecord record;
    std::memcpy(static_cast<void*>(&record), bytes + i * kBytes, kBytes);
    out[i] = record;
  }
}

/// Reads one piece through a buffer, as many records at a time as the buffer holds.
void read_piece(const SpillFile& file, const SpillReader::Piece& piece,
                std::span<std::byte> buffer) {
  SpillPlace place = piece.place;
  for (std::span<PointRecord> out = piece.out; !out.empty();) {
    const std::size_t count =
        std::min(out.size(), (buffer.size() - place.offset % kDirectBytes) / piece.record_bytes);
    const DirectRange range(place.offset, count * piece.record_bytes);
    file.read_at({place.volume, range.begin}, buffer.first(range.whole));
    const std::byte* const from = buffer.data() + range.lead;
    piece.record_bytes == kSpilledBytes ? unpack<kSpilledBytes>(from, out.first(count))
                                        : unpack<kEmittingBytes>(from, out.first(count));
    out = out.subspan(count);
    place.offset += range.bytes;
  }
}

/// Writes a range by several transfers at once.
void write_pieces(DirectFile& file, std::uint64_t offset, std::span<const std::byte> bytes) {
  for_each_transfer(
      (bytes.size() + kWriteBytes - 1) / kWriteBytes, [&](std::size_t i, std::size_t) {
        const std::size_t begin = i * kWriteBytes;
        file.write_at(offset + begin,
                      bytes.subspan(begin, std::min(kWriteBytes, bytes.size() - begin)));
      });
}

}  // namespace

SpillFile::SpillFile(std::span<const std::filesystem::path> directories) {
  for (const auto& directory : directories) volumes_.push_back(std::make_unique<Volume>(directory));
}

SpillFile SpillFile::named(std::span<const std::filesystem::path> names) {
  SpillFile file;
  for (const auto& name : names)
    file.volumes_.push_back(std::make_unique<Volume>(name, DirectFile::Kept::made, 0));
  return file;
}

SpillFile SpillFile::reopened(StateReader& state) {
  SpillFile file;
  for (std::uint64_t count = state.get_count(kMaxVolumes); count > 0; --count) {
    const std::filesystem::path name = state.get_text();
    const auto end = state.get<std::uint64_t>();
    std::error_code missing;
    const bool whole = std::filesystem::file_size(name, missing) == end && !missing;
    state.require(whole, name.string() + " is missing or does not have the recorded length");
    file.volumes_.push_back(std::make_unique<Volume>(name, DirectFile::Kept::found, end));
  }
  return file;
}

void SpillFile::save(StateWriter& state) {
  state.put(std::uint64_t{volumes_.size()});
  for (const auto& volume : volumes_) {
    volume->file.sync();
    sync_directory(volume->place);
    state.put_text(volume->place.string());
    state.put(volume->end.load());
  }
}

std::vector<std::uint32_t> SpillFile::by_room(std::uint64_t bytes) const {
  std::vector<double> fill;
  for (const auto& volume : volumes_) {
    std::error_code unknown;  // a write will report what is wrong
    const std::uint64_t free = std::filesystem::space(volume->place, unknown).available;
    const auto used = static_cast<double>(volume->end + bytes);
    fill.push_back(
        unknown ? used
                : used / (static_cast<double>(volume->end) + static_cast<double>(free) + 1.0));
  }
  std::vector<std::uint32_t> order(volumes_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, {}, [&](std::uint32_t v) { return fill[v]; });
  return order;
}

SpillPlace SpillFile::append(std::span<const std::byte> packed) {
  const std::span bytes(packed.data(), direct_blocks(packed.size()));
  const std::vector<std::uint32_t> order = by_room(bytes.size());
  for (const std::uint32_t v : order) {
    Volume& volume = *volumes_[v];
    const SpillPlace place{v, volume.end};
    try {
      write_pieces(volume.file, place.offset, bytes);
    } catch (const std::system_error& error) {
      if (v == order.back() || !is_full(error.code())) throw;
      volume.file.discard(place.offset, bytes.size());  // the part that was written
      continue;
    }
    volume.end += bytes.size();
    return place;
  }
  throw std::invalid_argument("SpillFile: no directory");
}

bool SpillFile::holds(const SpillPlace& place, std::uint64_t bytes) const noexcept {
  if (place.volume >= volumes_.size() || place.offset % kDirectBytes != 0) return false;
  const std::uint64_t end = volumes_[place.volume]->end;
  return place.offset <= end && bytes <= end - place.offset;
}

void SpillFile::read_at(const SpillPlace& place, std::span<std::byte> bytes) const {
  volumes_[place.volume]->file.read_at(place.offset, bytes);
}

void SpillFile::refuse(const SpillPlace& place, std::size_t points) const {
  throw DataError(volumes_[place.volume]->place.string() + ": offset " +
                  std::to_string(place.offset) + ": the " + std::to_string(points) +
                  " points there are not what was written");
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

SpillReader::SpillReader(std::size_t buffer_bytes)
    : buffer_(buffer_bytes / (kTransfers * kDirectBytes) * (kTransfers * kDirectBytes)) {
  if (buffer_.size() < kMinBytes) throw std::invalid_argument("SpillReader: buffer too small");
}

void SpillReader::read(const SpillFile& file, std::span<const Piece> pieces) {
  const std::size_t share = buffer_.size() / kTransfers;
  for_each_transfer(pieces.size(), [&](std::size_t i, std::size_t worker) {
    read_piece(file, pieces[i], {buffer_.data() + worker * share, share});
  });
}

Partition::Partition(SpillFile& file, Splitters splitters, bool kept, std::size_t record_bytes)
    : file_(file), splitters_(std::move(splitters)), kept_(kept), record_bytes_(record_bytes) {}

Partition::Partition(SpillFile& file, StateReader& state)
    : file_(file), splitters_(state), kept_(true), record_bytes_(state.get<std::uint64_t>()) {
  state.require(record_bytes_ == kSpilledBytes || record_bytes_ == kEmittingBytes,
                "records have another size than this program writes");
  const std::uint64_t ends = ranges() + 1;
  for (std::uint64_t count = state.get<std::uint64_t>(); count > 0; --count) {
    Run& run = runs_.emplace_back();
    run.place = {state.get<std::uint32_t>(), state.get<std::uint64_t>()};
    for (std::uint64_t i = 0; i < ends; ++i) {
      run.starts.push_back(state.get<std::uint32_t>());
      state.require(i == 0 ? run.starts[i] == 0 : run.starts[i - 1] <= run.starts[i],
                    "the ranges of a run do not ascend");
    }
    for (std::uint64_t i = 0; i < ranges(); ++i) run.digests.push_back(state.get<std::uint64_t>());
    state.require(file_.holds(run.place, run.starts.back() * record_bytes_),
                  "a run lies past the end of its file");
  }
}

void Partition::save(StateWriter& state) const {
  splitters_.save(state);
  state.put(std::uint64_t{record_bytes_});
  state.put(std::uint64_t{runs_.size()});
  for (const Run& run : runs_) {
    state.put(run.place.volume);
    state.put(run.place.offset);
    for (const std::uint32_t start : run.starts) state.put(start);
    for (const std::uint64_t digest : run.digests) state.put(digest);
  }
}

std::uint64_t Partition::size(std::size_t range) const noexcept {
  std::uint64_t size = 0;
  for (const Run& run : runs_) size += run.size(range);
  return size;
}

void Partition::discard(std::size_t range) const noexcept {
  for (const Run& run : runs_)
    file_.discard(place_of(run, range, 0), run.size(range) * record_bytes_);
}

void Partition::find_ranges(std::span<const PointRecord> records,
                            std::span<std::uint16_t> range_of) const noexcept {
  for (std::size_t i = 0; i < records.size(); ++i)
    range_of[i] = static_cast<std::uint16_t>(splitters_(records[i].key));
}

void Partition::find_ranges(std::span<const PointRecord> records, std::span<std::uint16_t> range_of,
                            const Executor& executor) const {
  constexpr std::size_t kGrain = 1 << 14;
  executor.for_ranges(records.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    find_ranges(records.subspan(begin, end - begin), range_of.subspan(begin));
  });
}

Partition::Starts Partition::group_run(std::span<const PointRecord> records,
                                       std::span<const std::uint16_t> range_of,
                                       std::span<std::byte> grouped,
                                       const Executor& executor) const {
  const std::size_t blocks = partition_blocks(records.size(), ranges(), executor.threads());
  const ClassCounts counts(records, range_of, ranges(), blocks, executor);
  const auto known = [&](const PointRecord& record) {
    return range_of[static_cast<std::size_t>(&record - records.data())];
  };
  record_bytes_ == kSpilledBytes
      ? counts.scatter_packed<kSpilledBytes>(grouped.data(), known, executor)
      : counts.scatter_packed<kEmittingBytes>(grouped.data(), known, executor);
  const std::vector<std::size_t> starts = counts.starts();
  Starts ends(starts.size());
  std::ranges::transform(starts, ends.begin(),
                         [](std::size_t i) { return static_cast<std::uint32_t>(i); });
  return ends;
}

void Partition::write_run(std::span<const std::byte> grouped, Starts starts) {
  Run run{.place = {}, .starts = std::move(starts), .digests = {}};
  for (std::size_t range = 0; kept_ && range < ranges(); ++range) {
    const auto part =
        grouped.subspan(run.starts[range] * record_bytes_, run.size(range) * record_bytes_);
    run.digests.push_back(digest_of(part, record_bytes_, record_bytes_, 0));
  }
  run.place = file_.append(grouped.first(run.starts.back() * record_bytes_));
  runs_.push_back(std::move(run));
}

BucketReader::BucketReader(std::shared_ptr<const Partition> partition, std::size_t range)
    : partition_(std::move(partition)), range_(range) {
  size_ = left_ = partition_->size(range);
}

bool BucketReader::single_key() const noexcept {
  return partition_->splitters_.single_key(range_);
}

std::size_t BucketReader::read(std::span<PointRecord> out, SpillReader& reader) {
  // Collect the pieces that fill `out`, from one run after another.
  std::vector<SpillReader::Piece> pieces;
  std::size_t filled = 0;
  const std::size_t first_run = run_, first_at = at_;
  while (filled < out.size() && left_ > 0) {
    const Partition::Run& run = partition_->runs_[run_];
    const std::size_t count = std::min(run.size(range_) - at_, out.size() - filled);
    if (count > 0) {
      pieces.push_back({partition_->place_of(run, range_, at_), out.subspan(filled, count),
                        partition_->record_bytes_});
    }
    filled += count;
    at_ += count;
    left_ -= count;
    if (at_ == run.size(range_)) {
      ++run_;
      at_ = 0;
    }
  }
  // Read them, then check them or give back their disk blocks.
  reader.read(partition_->file_, pieces);
  if (kept()) {
    verify(first_run, first_at, out.first(filled));
    return filled;
  }
  for (const SpillReader::Piece& piece : pieces)
    partition_->file_.discard(piece.place, piece.out.size() * piece.record_bytes);
  return filled;
}

/// Adds records to the checksum, and compares it where a run's part of the range ends.
/// @param records  the records of the range from number `at` of a run on
void BucketReader::verify(std::size_t run, std::size_t at, std::span<const PointRecord> records) {
  for (; !records.empty(); ++run, at = 0) {
    const Partition::Run& from = partition_->runs_[run];
    const std::size_t size = from.size(range_), count = std::min(size - at, records.size());
    digest_ += digest_of(std::as_bytes(records.first(count)), partition_->record_bytes_,
                         sizeof(PointRecord), at);
    records = records.subspan(count);
    if (at + count < size) return;
    if (std::exchange(digest_, 0) != from.digests[range_])
      partition_->file_.refuse(partition_->place_of(from, range_, 0), size);
  }
}

std::vector<MortonKey> BucketReader::sample(std::size_t count, SpillReader& reader) const {
  std::vector<PointRecord> records(static_cast<std::size_t>(std::min<std::uint64_t>(count, size_)));
  std::vector<SpillReader::Piece> pieces;
  std::uint64_t begin = 0;  // number of the run's first record among all records of the range
  for (const Partition::Run& run : partition_->runs_) {
    const std::uint64_t end = begin + run.size(range_);
    for (std::size_t i = pieces.size(); i < records.size(); ++i) {
      const std::uint64_t position = sample_position(i, records.size(), size_);
      if (position >= end) break;
      pieces.push_back({partition_->place_of(run, range_, position - begin),
                        {&records[i], 1},
                        partition_->record_bytes_});
    }
    begin = end;
  }
  reader.read(partition_->file_, pieces);

  std::vector<MortonKey> keys;
  for (const PointRecord& record : records) keys.push_back(record.key);
  return keys;
}

}  // namespace ptc
