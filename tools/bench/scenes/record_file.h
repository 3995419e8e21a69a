// Point records on the disk, read and written from end to end past the system's page cache. They
// are the input of the sorts and builds that are measured, and give the time of the disk alone.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/memory.h"
#include "engine/sort/direct_file.h"
#include "engine/sort/sort_plan.h"
#include "engine/sort/transfers.h"
#include "format/point_record.h"

namespace ptc::bench {

/// A file of point records. It has no name and is gone with its object.
class RecordFile {
 public:
  /// Creates an empty file in a directory. @throws std::system_error
  explicit RecordFile(const std::filesystem::path& directory)
      : file_(std::make_unique<DirectFile>(directory)) {}

  /// The number of records that one transfer moves: whole blocks of the disk, about 4 MB.
  static constexpr std::size_t kBlock = 200 * kPageRecords;
  static_assert(kBlock * sizeof(PointRecord) % kDirectBytes == 0);

  [[nodiscard]] std::uint64_t records() const noexcept { return records_; }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return records_ * sizeof(PointRecord); }
  /// Fills the file with this many records of random bits.
  void fill(std::uint64_t records);
  /// Reads this file whole and writes its bytes to another file, which holds nothing else then. The
  /// other file may be this one.
  /// @param most  bytes to write at most; a record that they hold only in part does not count as
  ///              one of the other file's
  void copy_to(RecordFile& other, std::uint64_t most = ~std::uint64_t{0}) const;

 private:
  friend class RecordWriter;
  friend class RecordReader;
  /// Bytes that a transfer of block `block` moves, rounded up to the disk's blocks.
  [[nodiscard]] std::size_t block_bytes(std::uint64_t block) const noexcept;

  std::unique_ptr<DirectFile> file_;
  std::uint64_t records_ = 0;
};

/// Appends records to a file. Up to kTransfers blocks are written while the next is filled.
class RecordWriter {
 public:
  explicit RecordWriter(RecordFile& file);
  /// Appends records. @throws std::system_error of this write or an earlier one
  void write(std::span<const PointRecord> records);
  /// Writes the last, partly filled block, and waits for all writes. Without this call the file's
  /// end is missing. @throws std::system_error
  void finish();

 private:
  void flush();
  RecordFile& file_;
  Arena buffers_;
  std::size_t filled_ = 0;  ///< records in the block that is written next
  std::uint64_t next_ = 0;  ///< block that is written next
  std::array<std::future<void>, kTransfers> writing_;
};

/// Reads a file in order. The next blocks are read while the caller uses one.
class RecordReader {
 public:
  explicit RecordReader(const RecordFile& file);
  ~RecordReader();
  /// Returns the next records, at most RecordFile::kBlock; none at the end. They are valid until
  /// the next call. @throws std::system_error
  [[nodiscard]] std::span<const PointRecord> next();

 private:
  void read_ahead();
  const RecordFile& file_;
  Arena buffers_;
  std::uint64_t next_ = 0, ahead_ = 0;  ///< blocks: handed out next, read next
  std::array<std::future<void>, kTransfers> reading_;
};

/// Returns keys at even steps through a file, at most 100,000, as a build samples its input.
[[nodiscard]] std::vector<MortonKey> sample_of(const RecordFile& input);

/// Makes the procedural city and hands it to `sink`, at most 4,096 records at once, block of houses
/// by block of houses.
/// @param points  wanted of the city, as make_city() takes them
/// @return the frame of the records' keys
Frame for_each_city_record(std::uint64_t points,
                           const std::function<void(std::span<const PointRecord>)>& sink);

}  // namespace ptc::bench
