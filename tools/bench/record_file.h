// Point records on the disk, read and written from end to end past the page cache.
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/memory.h"
#include "engine/sort/direct_file.h"
#include "engine/sort/sort_plan.h"
#include "format/point_record.h"

namespace ptc::bench {

/// A file without a name, gone with its object.
class RecordFile {
 public:
  explicit RecordFile(const std::filesystem::path& directory) : file_(std::make_unique<DirectFile>(directory)) {}

  /// Records that are transferred at once: whole blocks of the disk.
  static constexpr std::size_t kBlock = 200 * kPageRecords;
  static_assert(kBlock * sizeof(PointRecord) % kDirectBytes == 0);

  [[nodiscard]] std::uint64_t records() const noexcept { return records_; }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return records_ * sizeof(PointRecord); }
  /// As many bytes again in another file: several blocks under way at once, read and written.
  void copy_to(RecordFile& other) const;

 private:
  friend class RecordWriter;
  friend class RecordReader;
  [[nodiscard]] std::size_t block_bytes(std::uint64_t block) const noexcept;  ///< rounded up to the disk's blocks

  std::unique_ptr<DirectFile> file_;
  std::uint64_t records_ = 0;
};

/// Appends to a file, a block being written while the next is filled.
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
  std::size_t filled_ = 0, half_ = 0;
  std::uint64_t offset_ = 0;
  std::future<void> writing_;
};

/// Reads a file in order, the next block while one is in use.
class RecordReader {
 public:
  explicit RecordReader(const RecordFile& file);
  ~RecordReader();
  /// Up to kBlock records, valid until the next call; none at the end.
  [[nodiscard]] std::span<const PointRecord> next();

 private:
  void read_ahead();
  [[nodiscard]] PointRecord* half(std::uint64_t block) const noexcept;
  const RecordFile& file_;
  Arena buffers_;
  std::uint64_t next_ = 0;  ///< block
  std::future<void> reading_;
};

}  // namespace ptc::bench
