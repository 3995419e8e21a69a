// Records on disk, grouped by the ranges that their keys lie in.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/memory.h"
#include "engine/sort/direct_file.h"
#include "engine/sort/splitters.h"
#include "format/point_record.h"

namespace ptc {

/// Where records lie.
struct SpillPlace {
  std::uint32_t volume = 0;
  std::uint64_t offset = 0;  ///< bytes
};

/// Temporary files of records, one volume in each of several directories. Threads: one appends, others may read and
/// discard what it has appended.
class SpillFile {
 public:
  /// @param directories  at least one
  /// @throws std::system_error naming the directory
  explicit SpillFile(std::span<const std::filesystem::path> directories);

  /// Writes records to the volume that this leaves least full, by its directory's room; when there is none left, to
  /// the others.
  /// @param records  at an address that is a multiple of kDirectBytes, in memory that can be read
  ///                 up to the next such multiple behind them
  /// @return  their place, its offset a multiple of kDirectBytes
  /// @throws std::system_error naming the directory
  [[nodiscard]] SpillPlace append(std::span<const PointRecord> records);
  void read_at(const SpillPlace& place, std::span<std::byte> bytes) const;
  /// Gives back the disk's blocks that end in these bytes, which are not read again, nor those in front of them in
  /// their first block.
  void discard(const SpillPlace& place, std::uint64_t bytes) const noexcept;
  /// Bytes appended so far.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  struct Volume {
    explicit Volume(const std::filesystem::path& where) : directory(where), file(where) {}
    std::filesystem::path directory;
    DirectFile file;
    std::atomic<std::uint64_t> end{0};
  };
  /// Numbers of the volumes, those first that so many bytes leave least full.
  [[nodiscard]] std::vector<std::uint32_t> by_room(std::uint64_t bytes) const;

  std::vector<std::unique_ptr<Volume>> volumes_;
};

/// Reads from any offset of a SpillFile, several pieces at once, through memory of its own.
class SpillReader {
 public:
  /// Consecutive records in the file and where they go.
  struct Piece {
    SpillPlace place;
    std::span<PointRecord> out;
  };

  /// @param buffer_bytes  of all reads that run at once, at least kLeastBytes
  SpillReader(const SpillFile& file, std::size_t buffer_bytes);
  void read(std::span<const Piece> pieces);
  /// The same for the last time: the disk's blocks are given back.
  void take(std::span<const Piece> pieces);

  /// A disk gives its full rate to several requests at once.
  static constexpr std::size_t kReads = 4;
  static constexpr std::size_t kLeastBytes = kReads * 2 * kDirectBytes;

 private:
  void read(const Piece& piece, std::span<std::byte> buffer) const;

  const SpillFile& file_;
  Arena buffer_;
};

/// What lies in a SpillFile of each range of keys. Records come in runs, each as large as memory
/// allows, that are grouped by range:
///
///   file  | run 0: range 0, range 1, ... | run 1: range 0, range 1, ... | ...
///
/// The runs' parts of one range, one after another, are its records in the order of the input.
class Partition {
 public:
  Partition(SpillFile& file, Splitters splitters);

  /// Groups a run into `grouped`, as long as `records`, stable; write_run() must follow.
  void add_run(std::span<const PointRecord> records, std::span<PointRecord> grouped, const Executor& executor);
  /// Writes what add_run() has grouped, as SpillFile::append().
  void write_run(std::span<const PointRecord> grouped);

  [[nodiscard]] std::size_t ranges() const noexcept { return splitters_.size(); }

 private:
  friend class BucketReader;
  struct Run {
    SpillPlace place;
    std::vector<std::uint32_t> starts;  // of each range in the run, and the end
  };

  SpillFile& file_;
  Splitters splitters_;
  std::vector<Run> runs_;
};

/// Reads the records of one range in the order of the input. What was read leaves the disk: ranges of a partition
/// are read by ascending number.
class BucketReader {
 public:
  BucketReader(std::shared_ptr<const Partition> partition, std::size_t range);

  /// How many there are.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// How many were not read yet.
  [[nodiscard]] std::uint64_t left() const noexcept { return left_; }
  /// True when all have the same key.
  [[nodiscard]] bool single_key() const noexcept;
  /// Fills the front of `out`. @return how many
  [[nodiscard]] std::size_t read(std::span<PointRecord> out, SpillReader& reader);
  /// `count` keys, at least 1, from all parts of the range.
  [[nodiscard]] std::vector<MortonKey> sample(std::size_t count, SpillReader& reader) const;

 private:
  [[nodiscard]] std::size_t size_in(const Partition::Run& run) const noexcept;
  [[nodiscard]] SpillPlace place_in(const Partition::Run& run, std::size_t i) const noexcept;

  std::shared_ptr<const Partition> partition_;
  std::size_t range_;
  std::uint64_t size_ = 0;
  std::uint64_t left_ = 0;
  std::size_t run_ = 0;  // where to read on
  std::size_t at_ = 0;   // in that run's part
};

}  // namespace ptc
