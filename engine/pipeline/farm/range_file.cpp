#include "engine/pipeline/farm/range_file.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>

#include "engine/base/background.h"
#include "engine/base/error.h"
#include "engine/io/file/direct_range.h"
#include "engine/io/file/state_file.h"
#include "engine/io/file/temporary_name.h"
#include "engine/sort/record_values.h"
#include "format/checksum.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::size_t kMinBlock = 64, kMaxBlock = std::size_t{1} << 14;  // points
// Two blocks are on their way to the file, and the values of one are unpacked.
constexpr std::size_t kMoreBlocks = 3;
// The plan, the place of the rows and of the index, the number of ranges, the checksum of these.
constexpr std::size_t kEndBytes = 5 * sizeof(std::uint64_t);
constexpr std::size_t kRowBytes = 3 * sizeof(std::uint64_t);  // of the table

/// Takes the values of points apart from the bytes of a group: records with the points' keys.
void unpack_values(std::span<const PointRecord> points, const std::byte* from, std::size_t bytes,
                   std::vector<PointRecord>& records) {
  records.assign(points.size(), {});
  for (std::size_t i = 0; i < points.size(); ++i, from += bytes) {
    records[i].key = points[i].key;
    std::memcpy(values_of(records[i]), from, bytes);
  }
}

/// Returns the bytes of an entry of the index.
std::size_t entry_bytes(const RangeRow& row) {
  return 2 * sizeof(std::uint64_t) + (1 + row.group_bytes.size()) * sizeof(RecordsDigest);
}

/// Returns the checksum of the rows of a range, and of what else its entry says.
std::uint64_t checksum_of(std::span<const std::byte> rows, std::uint64_t plan, std::size_t range,
                          std::uint64_t first_row, std::span<const RecordsDigest> digests) {
  const std::array<std::uint64_t, 3> whose{plan, range, first_row};
  Xxh3 hash(0);
  hash.add(std::as_bytes(std::span(whose)));
  hash.add(std::as_bytes(digests));
  hash.add(rows);
  return hash.value();
}

/// Says whether a container may hold a point.
bool fits_container(const PointRecord& point) noexcept {
  return is_storable(point) && (point.key.high | point.key.low) >> 63 == 0;
}

}  // namespace

std::size_t RangeRow::bytes() const noexcept {
  return std::accumulate(group_bytes.begin(), group_bytes.end(), sizeof(PointRecord));
}

std::size_t RangeWriter::block_points(std::size_t ranges, const RangeRow& row,
                                      std::uint64_t memory_bytes) {
  const std::uint64_t points = memory_bytes / ((ranges + kMoreBlocks) * row.bytes());
  return static_cast<std::size_t>(std::min<std::uint64_t>(points, kMaxBlock));
}

std::uint64_t RangeWriter::least_memory(std::size_t ranges, const RangeRow& row) {
  return (ranges + kMoreBlocks) * kMinBlock * row.bytes();
}

RangeWriter::RangeWriter(const std::filesystem::path& target, std::uint64_t plan,
                         std::span<const MortonKey> cuts, RangeRow row, std::uint64_t memory_bytes)
    : target_(target),
      partial_(temporary_name(target)),
      temporary_(partial_),
      file_(partial_, DirectFile::Kept::fresh),
      plan_(plan),
      cuts_(cuts.begin(), cuts.end()),
      row_(std::move(row)),
      open_(cuts.size() + 1) {
  if (memory_bytes < least_memory(open_.size(), row_))
    throw std::invalid_argument("RangeWriter: too little memory");
  block_points_ = block_points(open_.size(), row_, memory_bytes);
  for (Open& open : open_) open.digests.resize(1 + row_.group_bytes.size());
  for (Arena& arena : packed_) arena = Arena(direct_blocks(block_points_ * row_.bytes()));
}

std::size_t RangeWriter::range_of(const MortonKey& key) const {
  const bool in_last =
      (last_ == 0 || cuts_[last_ - 1] <= key) && (last_ == cuts_.size() || key < cuts_[last_]);
  if (in_last) return last_;
  return static_cast<std::size_t>(std::ranges::upper_bound(cuts_, key) - cuts_.begin());
}

void RangeWriter::add(std::span<const PointRecord> points,
                      std::span<const std::vector<PointRecord>> values) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    last_ = range_of(points[i].key);
    Open& open = open_[last_];
    if (open.points.capacity() == 0) {
      open.points.reserve(block_points_);
      open.values.resize(block_points_ * (row_.bytes() - sizeof(PointRecord)));
    }
    std::byte* to = open.values.data();
    for (std::size_t group = 0; group < values.size(); ++group) {
      const std::size_t bytes = row_.group_bytes[group];
      std::memcpy(to + open.points.size() * bytes,
                  reinterpret_cast<const std::byte*>(&values[group][i]) + sizeof(MortonKey), bytes);
      to += block_points_ * bytes;
    }
    open.points.push_back(points[i]);
    if (open.points.size() == block_points_) flush(last_);
  }
}

void RangeWriter::flush(std::size_t range) {
  Open& open = open_[range];
  const std::size_t count = open.points.size();
  if (count == 0) return;
  const std::span<std::byte> bytes(packed_[turn_].data(), count * row_.bytes());
  open.digests[0] = sum(open.digests[0], digest_of(open.points));
  std::memcpy(bytes.data(), open.points.data(), count * sizeof(PointRecord));
  std::byte* to = bytes.data() + count * sizeof(PointRecord);
  const std::byte* from = open.values.data();
  for (std::size_t group = 0; group < row_.group_bytes.size(); ++group) {
    const std::size_t size = row_.group_bytes[group];
    std::memcpy(to, from, count * size);
    unpack_values(open.points, from, size, unpacked_);
    open.digests[group + 1] = sum(open.digests[group + 1], digest_of(unpacked_));
    to += count * size;
    from += block_points_ * size;
  }
  blocks_.push_back({static_cast<std::uint32_t>(range), end_, count, xxh3_64(bytes)});
  open.points.clear();
  write({bytes.data(), direct_blocks(bytes.size())});
  turn_ = 1 - turn_;
}

/// Writes whole blocks of the file in the background, behind those of the call before.
void RangeWriter::write(std::span<const std::byte> bytes) {
  if (writing_.valid()) writing_.get();
  writing_ = in_background([this, bytes, at = end_] { file_.write_at(at, bytes); });
  end_ += bytes.size();
}

void RangeWriter::write_table() {
  // Make the rows, range by range, and the index
  std::ranges::stable_sort(blocks_, {}, &RangeBlock::range);
  StateWriter index;
  std::vector<std::byte> bytes;
  std::uint64_t rows = 0;
  const auto put_entry = [&](std::uint64_t xxh3, std::span<const RecordsDigest> digests) {
    index.put(rows);
    index.put(xxh3);
    for (const RecordsDigest& digest : digests) {
      index.put(digest[0]);
      index.put(digest[1]);
    }
  };
  auto block = blocks_.begin();
  for (std::size_t range = 0; range < open_.size(); ++range) {
    StateWriter own;
    std::uint64_t count = 0;
    for (; block != blocks_.end() && block->range == range; ++block, ++count) {
      own.put(block->offset);
      own.put(block->points);
      own.put(block->xxh3);
    }
    const std::vector<std::byte> of_range = own.take();
    const std::vector<RecordsDigest>& digests = open_[range].digests;
    put_entry(checksum_of(of_range, plan_, range, rows, digests), digests);
    bytes.insert(bytes.end(), of_range.begin(), of_range.end());
    rows += count;
  }
  put_entry(0, std::vector<RecordsDigest>(1 + row_.group_bytes.size()));

  // Write them, and behind them where they are
  StateWriter end;
  end.put(plan_);
  end.put(end_);
  end.put(end_ + bytes.size());
  end.put(std::uint64_t{open_.size()});
  std::vector<std::byte> last = end.take();
  end.put(xxh3_64(last));
  const std::vector<std::byte> checksum = end.take();
  last.insert(last.end(), checksum.begin(), checksum.end());
  const std::vector<std::byte> entries = index.take();
  bytes.insert(bytes.end(), entries.begin(), entries.end());
  Arena whole(direct_blocks(bytes.size() + kEndBytes));
  std::ranges::copy(bytes, whole.data());
  std::ranges::copy(last, whole.data() + whole.size() - kEndBytes);
  write({whole.data(), whole.size()});
  writing_.get();
}

void RangeWriter::finish() {
  for (std::size_t range = 0; range < open_.size(); ++range) {
    flush(range);
    open_[range].points = {};
    open_[range].values = {};
  }
  write_table();
  file_.sync();
  std::filesystem::rename(partial_, target_);
  sync_directory(target_);
}

RangeBlocks read_ranges(const std::filesystem::path& path, std::uint64_t plan, const RangeRow& row,
                        std::size_t first, std::size_t end) {
  const std::string name = path.string();
  const auto require = [&](bool holds, const char* what) {
    if (!holds) throw DataError(name + ": " + what);
  };
  const InputFile file(path);
  const auto read = [&](std::uint64_t offset, std::uint64_t count) {
    std::vector<std::byte> bytes(static_cast<std::size_t>(count));
    file.read_at(offset, bytes);
    return bytes;
  };
  // Find rows and index
  require(file.size() >= kEndBytes, "the file is shorter than it was");
  const std::uint64_t end_at = file.size() - kEndBytes;
  const std::vector<std::byte> last = read(end_at, kEndBytes);
  StateReader places(last, name, end_at);
  const auto own_plan = places.get<std::uint64_t>(), rows_at = places.get<std::uint64_t>(),
             index_at = places.get<std::uint64_t>(), ranges = places.get<std::uint64_t>();
  require(places.get<std::uint64_t>() == xxh3_64(std::span(last).first(kEndBytes - 8)) &&
              rows_at <= index_at && index_at <= end_at &&
              ranges < (end_at - index_at) / entry_bytes(row),
          "the end of the file is damaged");
  require(own_plan == plan, "the file is of another plan");
  require(first <= end && end <= ranges, "the file has fewer ranges");

  // Read the entries of the ranges
  const std::uint64_t most = (index_at - rows_at) / kRowBytes;
  const std::uint64_t own_at = index_at + first * entry_bytes(row);
  const std::vector<std::byte> index = read(own_at, (end - first + 1) * entry_bytes(row));
  StateReader entries(index, name, own_at);
  std::vector<std::uint64_t> begin, xxh3;
  std::vector<std::vector<RecordsDigest>> digests;
  for (std::size_t i = first; i <= end; ++i) {
    begin.push_back(entries.get_count(most));
    xxh3.push_back(entries.get<std::uint64_t>());
    digests.emplace_back();
    for (std::size_t set = 0; set <= row.group_bytes.size(); ++set) {
      digests.back().push_back({entries.get<std::uint64_t>(), entries.get<std::uint64_t>()});
    }
  }
  require(std::ranges::is_sorted(begin), "the index of the file is damaged");

  // Read their rows
  const std::uint64_t offset = rows_at + begin.front() * kRowBytes;
  const std::vector<std::byte> bytes = read(offset, (begin.back() - begin.front()) * kRowBytes);
  StateReader rows(bytes, name, offset);
  RangeBlocks found;
  found.digests.resize(1 + row.group_bytes.size());
  for (std::size_t i = 0; i < end - first; ++i) {
    const auto own = std::span(bytes).subspan((begin[i] - begin.front()) * kRowBytes,
                                              (begin[i + 1] - begin[i]) * kRowBytes);
    require(checksum_of(own, plan, first + i, begin[i], digests[i]) == xxh3[i],
            "the table of the file is damaged");
    for (std::size_t set = 0; set < found.digests.size(); ++set)
      found.digests[set] = sum(found.digests[set], digests[i][set]);
    for (std::uint64_t at = begin[i]; at < begin[i + 1]; ++at) {
      RangeBlock block{.range = static_cast<std::uint32_t>(first + i)};
      block.offset = rows.get_count(rows_at);
      block.points = rows.get_count((rows_at - block.offset) / row.bytes());
      block.xxh3 = rows.get<std::uint64_t>();
      found.blocks.push_back(block);
    }
  }
  return found;
}

RangeReader::RangeReader(const std::filesystem::path& path, RangeRow row,
                         std::span<const RangeBlock> blocks)
    : path_(path), file_(path, DirectFile::Kept::found), row_(std::move(row)), blocks_(blocks) {}

bool RangeReader::next() {
  if (at_ == blocks_.size()) return false;
  const RangeBlock& block = blocks_[at_++];
  const auto count = static_cast<std::size_t>(block.points);
  const std::size_t whole = direct_blocks(count * row_.bytes());
  if (bytes_.size() < whole) bytes_ = Arena(whole);
  file_.read_at(block.offset, {bytes_.data(), whole});
  if (xxh3_64({bytes_.data(), count * row_.bytes()}) != block.xxh3) {
    throw DataError(path_.string() + ": offset " + std::to_string(block.offset) +
                    ": a block is damaged");
  }
  points_ = {reinterpret_cast<const PointRecord*>(bytes_.data()), count};
  for (std::size_t i = 0; i < count; ++i) {
    if (!fits_container(points_[i])) {
      throw DataError(fmt::format(
          "{}: offset {}: point {}: radius, radiance and emission must be finite and not negative, "
          "the key below 2^126 and the flags 0",
          path_.string(), block.offset, i));
    }
  }
  return true;
}

std::uint64_t RangeReader::sample_keys(std::uint64_t first, std::uint64_t every,
                                       std::vector<MortonKey>& keys) {
  constexpr std::uint64_t kPiece = 96;  // points that are read together
  constexpr std::size_t kStep = 12;     // from one key to the next
  points_ = {};
  for (const RangeBlock& block : blocks_) {
    for (; first < block.points; first += every) {
      const auto count = static_cast<std::size_t>(std::min(kPiece, block.points - first));
      const DirectRange piece(block.offset + first * sizeof(PointRecord),
                              count * sizeof(PointRecord));
      if (bytes_.size() < piece.whole) bytes_ = Arena(piece.whole);
      file_.read_at(piece.begin, {bytes_.data(), piece.whole});
      for (std::size_t i = 0; i < count; i += kStep) {
        PointRecord record;
        std::memcpy(&record, bytes_.data() + piece.lead + i * sizeof record, sizeof record);
        keys.push_back(record.key);
      }
    }
    first -= block.points;
  }
  return first;
}

void RangeReader::values(std::size_t group, std::vector<PointRecord>& records) const {
  const std::size_t count = points_.size();
  const std::byte* from = bytes_.data() + count * sizeof(PointRecord);
  for (std::size_t i = 0; i < group; ++i) from += count * row_.group_bytes[i];
  unpack_values(points_, from, row_.group_bytes[group], records);
}

}  // namespace ptc
