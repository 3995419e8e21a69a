// Point records on the disk, read and written from end to end past the page cache.
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

/// A file without a name, gone with its object.
class RecordFile {
 public:
  explicit RecordFile(const std::filesystem::path& directory)
      : file_(std::make_unique<DirectFile>(directory)) {}

  /// Records that are transferred at once: whole blocks of the disk.
  static constexpr std::size_t kBlock = 200 * kPageRecords;
  static_assert(kBlock * sizeof(PointRecord) % kDirectBytes == 0);

  [[nodiscard]] std::uint64_t records() const noexcept { return records_; }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return records_ * sizeof(PointRecord); }
  /// Writes so many records of noise from the file's beginning.
  void fill(std::uint64_t records);
  /// Reads all and writes as many bytes again to another file, or in its own place, which then
  /// holds no more.
  /// @param most  bytes to write when that is less; the other file's records are those that are
  /// whole in them
  void copy_to(RecordFile& other, std::uint64_t most = ~std::uint64_t{0}) const;

 private:
  friend class RecordWriter;
  friend class RecordReader;
  [[nodiscard]] std::size_t block_bytes(
      std::uint64_t block) const noexcept;  ///< rounded up to the disk's blocks

  std::unique_ptr<DirectFile> file_;
  std::uint64_t records_ = 0;
};

/// Appends to a file, blocks being written while the next is filled.
class RecordWriter {
 public:
  explicit RecordWriter(RecordFile& file);
  void write(std::span<const PointRecord> records);
  /// Writes what is left. Without it the file's end is missing.
  void finish();

 private:
  void flush();
  RecordFile& file_;
  Arena buffers_;
  std::size_t filled_ = 0;  ///< records of the block that is next
  std::uint64_t next_ = 0;  ///< block
  std::array<std::future<void>, kTransfers> writing_;
};

/// Reads a file in order, the next blocks while one is in use.
class RecordReader {
 public:
  explicit RecordReader(const RecordFile& file);
  ~RecordReader();
  /// Up to kBlock records, valid until the next call; none at the end.
  [[nodiscard]] std::span<const PointRecord> next();

 private:
  void read_ahead();
  const RecordFile& file_;
  Arena buffers_;
  std::uint64_t next_ = 0, ahead_ = 0;  ///< blocks: to be handed out, to be read
  std::array<std::future<void>, kTransfers> reading_;
};

/// Keys spread evenly over a file, as a build takes them of its input.
[[nodiscard]] std::vector<MortonKey> sample_of(const RecordFile& input);

/// The procedural city in blocks of up to 4,096 records, in the order of its blocks of houses.
/// @return the frame of their keys
Frame for_each_city_record(std::uint64_t points,
                           const std::function<void(std::span<const PointRecord>)>& sink);

}  // namespace ptc::bench
