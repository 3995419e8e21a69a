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
constexpr std::size_t kEndBytes =
    3 * sizeof(std::uint64_t);  // place, length, checksum of the table

/// Says whether a container may hold a point.
bool fits_container(const PointRecord& point) noexcept {
  return is_storable(point) && (point.key.high | point.key.low) >> 63 == 0;
}

}  // namespace

std::size_t RangeRow::bytes() const noexcept {
  return std::accumulate(group_bytes.begin(), group_bytes.end(), sizeof(PointRecord));
}

std::uint64_t RangeWriter::least_memory(std::size_t ranges, const RangeRow& row) {
  return (ranges + 2) * kMinBlock * row.bytes();
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
  // Two blocks more are on their way to the file
  const std::uint64_t points = memory_bytes / ((open_.size() + 2) * row_.bytes());
  block_points_ = static_cast<std::size_t>(std::min<std::uint64_t>(points, kMaxBlock));
  for (Arena& arena : packed_) arena = Arena(direct_blocks(block_points_ * row_.bytes()));
}

std::size_t RangeWriter::range_of(const MortonKey& key) const {
  return static_cast<std::size_t>(std::ranges::upper_bound(cuts_, key) - cuts_.begin());
}

void RangeWriter::add(std::span<const PointRecord> points,
                      std::span<const std::vector<PointRecord>> values) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t range = range_of(points[i].key);
    Open& open = open_[range];
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
    if (open.points.size() == block_points_) flush(range);
  }
}

void RangeWriter::flush(std::size_t range) {
  Open& open = open_[range];
  const std::size_t count = open.points.size();
  if (count == 0) return;
  const std::span<std::byte> bytes(packed_[turn_].data(), count * row_.bytes());
  std::memcpy(bytes.data(), open.points.data(), count * sizeof(PointRecord));
  std::byte* to = bytes.data() + count * sizeof(PointRecord);
  const std::byte* from = open.values.data();
  for (const std::size_t size : row_.group_bytes) {
    std::memcpy(to, from, count * size);
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

void RangeWriter::finish() {
  for (std::size_t range = 0; range < open_.size(); ++range) flush(range);
  StateWriter table;
  table.put(plan_);
  table.put(std::uint64_t{blocks_.size()});
  for (const RangeBlock& block : blocks_) {
    table.put(block.range);
    table.put(block.offset);
    table.put(block.points);
    table.put(block.xxh3);
  }
  const std::vector<std::byte> bytes = table.take();

  // The place of the table ends the file
  Arena last(direct_blocks(bytes.size() + kEndBytes));
  StateWriter place;
  place.put(end_);
  place.put(std::uint64_t{bytes.size()});
  place.put(xxh3_64(bytes));
  const std::vector<std::byte> end = place.take();
  std::ranges::copy(bytes, last.data());
  std::ranges::copy(end, last.data() + last.size() - end.size());
  write({last.data(), last.size()});
  writing_.get();

  // Publish it
  file_.sync();
  std::filesystem::rename(partial_, target_);
  sync_directory(target_);
}

std::vector<RangeBlock> read_range(const std::filesystem::path& path, std::uint64_t plan,
                                   const RangeRow& row, std::uint32_t range) {
  const std::string name = path.string();
  const auto require = [&](bool holds, const char* what) {
    if (!holds) throw DataError(name + ": " + what);
  };
  // Find the table
  const InputFile file(path);
  require(file.size() >= kEndBytes, "the file is shorter than it was");
  std::vector<std::byte> end(kEndBytes);
  file.read_at(file.size() - kEndBytes, end);
  StateReader places(end, name, file.size() - kEndBytes);
  const auto offset = places.get<std::uint64_t>(), length = places.get<std::uint64_t>(),
             xxh3 = places.get<std::uint64_t>();
  require(offset <= file.size() - kEndBytes && length <= file.size() - kEndBytes - offset,
          "the end of the file is damaged");

  // Read it
  std::vector<std::byte> bytes(static_cast<std::size_t>(length));
  file.read_at(offset, bytes);
  require(xxh3_64(bytes) == xxh3, "the table of the file is damaged");
  StateReader table(bytes, name, offset);
  require(table.get<std::uint64_t>() == plan, "the file is of another plan");
  std::vector<RangeBlock> blocks;
  for (std::uint64_t left = table.get_count(length); left > 0; --left) {
    RangeBlock block;
    block.range = table.get<std::uint32_t>();
    block.offset = table.get_count(offset);
    block.points = table.get_count((offset - block.offset) / row.bytes());
    block.xxh3 = table.get<std::uint64_t>();
    if (block.range == range) blocks.push_back(block);
  }
  table.end();
  return blocks;
}

RangeReader::RangeReader(const std::filesystem::path& path, RangeRow row,
                         std::vector<RangeBlock> blocks)
    : path_(path),
      file_(path, DirectFile::Kept::found),
      row_(std::move(row)),
      blocks_(std::move(blocks)) {}

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
  points_.resize(count);
  std::memcpy(points_.data(), bytes_.data(), count * sizeof(PointRecord));
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
  points_.clear();
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
  const std::size_t count = points_.size(), bytes = row_.group_bytes[group];
  const std::byte* from = bytes_.data() + count * sizeof(PointRecord);
  for (std::size_t i = 0; i < group; ++i) from += count * row_.group_bytes[i];
  records.assign(count, {});
  for (std::size_t i = 0; i < count; ++i, from += bytes) {
    records[i].key = points_[i].key;
    std::memcpy(values_of(records[i]), from, bytes);
  }
}

}  // namespace ptc
