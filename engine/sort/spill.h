// Records on disk, grouped by ranges of their keys.
//
// A sort writes its records in runs, each as large as memory allows and grouped by range. Later it
// reads one range at a time from all runs:
//
//   SpillFile     | run 0: range 0, range 1, ... | run 1: range 0, range 1, ... | ...
//                          \_______                       /
//   BucketReader                   \  range 0 of all runs, in the order of the input
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
#include "engine/io/file/state_file.h"
#include "engine/sort/direct_file.h"
#include "engine/sort/splitters.h"
#include "engine/sort/transfers.h"
#include "format/point_record.h"

namespace ptc {

/// Bytes of a record on disk: all but the emission, which is last.
inline constexpr std::size_t kSpilledBytes = offsetof(PointRecord, emission);
/// Bytes of a record on disk where records may have emission.
inline constexpr std::size_t kEmittingBytes = sizeof(PointRecord);

/// Where records lie in a SpillFile.
struct SpillPlace {
  std::uint32_t volume = 0;  ///< number of the volume
  std::uint64_t offset = 0;  ///< bytes from the start of the volume
};

/// Temporary files of records: one file, called a volume, in each of several directories.
/// Threads: one thread may append while others read and discard what was appended before.
class SpillFile {
 public:
  /// Creates volumes without names, which vanish with this object.
  /// @param directories  at least one
  /// @throws std::system_error naming the directory
  explicit SpillFile(std::span<const std::filesystem::path> directories);
  /// Creates named volumes, which stay. Existing files are overwritten.
  /// @throws std::system_error naming the file
  [[nodiscard]] static SpillFile named(std::span<const std::filesystem::path> names);
  /// Reopens the named volumes that save() recorded.
  /// @throws DataError when they have another length than they had; std::system_error
  [[nodiscard]] static SpillFile reopened(StateReader& state);
  /// Flushes named volumes to stable storage, and records their names and lengths.
  void save(StateWriter& state);

  /// Writes records to the volume that will then be the least full, by the room in its directory;
  /// if that has no room after all, to one of the others.
  /// @param packed  the record bytes of each record. Must begin at a multiple of kDirectBytes, in
  ///                memory that is readable up to the next such multiple after its end
  /// @return  where the records lie; the offset is a multiple of kDirectBytes
  /// @throws std::system_error naming the directory
  [[nodiscard]] SpillPlace append(std::span<const std::byte> packed);
  /// Returns whether a range lies within what was appended, at an offset that append() may return.
  [[nodiscard]] bool holds(const SpillPlace& place, std::uint64_t bytes) const noexcept;
  /// Reads a range. @throws DataError, std::system_error as DirectFile::read_at()
  void read_at(const SpillPlace& place, std::span<std::byte> bytes) const;
  /// Reports that this many points at a place differ from what was written. @throws DataError
  /// always, naming file and offset
  [[noreturn]] void refuse(const SpillPlace& place, std::size_t points) const;
  /// Gives back the disk blocks that end within a range. The first of them may begin before the
  /// range: neither the range nor those bytes can be read again.
  void discard(const SpillPlace& place, std::uint64_t bytes) const noexcept;
  /// Returns the bytes appended so far, to all volumes together.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  struct Volume {
    explicit Volume(const std::filesystem::path& directory) : place(directory), file(directory) {}
    Volume(const std::filesystem::path& name, DirectFile::Kept how, std::uint64_t bytes)
        : place(name), file(name, how), end(bytes) {}
    std::filesystem::path place;  ///< the directory; for a named volume the file
    DirectFile file;
    std::atomic<std::uint64_t> end{0};  ///< bytes appended
  };
  SpillFile() = default;
  /// Returns the numbers of all volumes, in the order of how full they would be with this many
  /// bytes more.
  [[nodiscard]] std::vector<std::uint32_t> by_room(std::uint64_t bytes) const;

  std::vector<std::unique_ptr<Volume>> volumes_;
};

/// Reads records from any offset of a SpillFile, several pieces at once, through a buffer of its
/// own.
class SpillReader {
 public:
  /// Consecutive records in the file and the memory that they are read into.
  struct Piece {
    SpillPlace place;
    std::span<PointRecord> out;
    std::size_t record_bytes;  ///< of a record in the file, kSpilledBytes or kEmittingBytes
  };

  /// @param buffer_bytes  buffer for all reads that run at once, at least kMinBytes
  explicit SpillReader(std::size_t buffer_bytes);
  /// Reads all pieces. @throws DataError, std::system_error as DirectFile::read_at()
  void read(const SpillFile& file, std::span<const Piece> pieces);

  static constexpr std::size_t kMinBytes = kTransfers * 2 * kDirectBytes;

 private:
  Arena buffer_;
};

/// The table of the runs in a SpillFile: where each range of keys lies in each run. The parts of
/// one range, run after run, are its records in the order of the input.
class Partition {
 public:
  /// @param file  must outlive this
  /// @param kept          records stay on disk after they are read, until they are discarded, and
  ///                      have checksums
  /// @param record_bytes  of a record on disk, kSpilledBytes or kEmittingBytes
  Partition(SpillFile& file, Splitters splitters, bool kept = false,
            std::size_t record_bytes = kSpilledBytes);
  /// Loads a kept partition that save() wrote. @throws DataError when the table does not fit the
  /// file
  Partition(SpillFile& file, StateReader& state);
  /// Records the splitters and the table of runs.
  void save(StateWriter& state) const;
  /// Returns the bytes of a record on disk.
  [[nodiscard]] std::size_t record_bytes() const noexcept { return record_bytes_; }

  /// The record numbers within a run where each range begins, and the end of the last one.
  using Starts = std::vector<std::uint32_t>;

  /// Writes the range number of each record to the front of `range_of`.
  /// Threads: may be called at any time.
  void find_ranges(std::span<const PointRecord> records,
                   std::span<std::uint16_t> range_of) const noexcept;
  /// Does the same with the threads of an executor.
  void find_ranges(std::span<const PointRecord> records, std::span<std::uint16_t> range_of,
                   const Executor& executor) const;
  /// Groups the records of a run by range, in their order within each range, and packs them as they
  /// go to disk. Threads: may run while another run is written.
  /// @param range_of  the range number of each record
  /// @param grouped   room for record_bytes() of each record
  [[nodiscard]] Starts group_run(std::span<const PointRecord> records,
                                 std::span<const std::uint16_t> range_of,
                                 std::span<std::byte> grouped, const Executor& executor) const;
  /// Writes a run that group_run() has grouped, under the conditions of SpillFile::append(). Runs
  /// must be written in the order of the input.
  void write_run(std::span<const std::byte> grouped, Starts starts);

  [[nodiscard]] std::size_t ranges() const noexcept { return splitters_.size(); }
  /// Returns the number of records in a range.
  [[nodiscard]] std::uint64_t size(std::size_t range) const noexcept;
  /// Gives back the disk blocks of a range. Ranges must be discarded in ascending order, because a
  /// block may hold the end of one range and the beginning of the next.
  void discard(std::size_t range) const noexcept;

 private:
  friend class BucketReader;
  struct Run {
    SpillPlace place;
    Starts starts;
    std::vector<std::uint64_t> digests;  ///< checksum of each range of a kept run, because a power
                                         ///< cut may lose bytes that were written

    /// Returns the number of records of a range in this run.
    [[nodiscard]] std::size_t size(std::size_t range) const noexcept {
      return starts[range + 1] - starts[range];
    }
  };

  /// Returns the place of the i-th record of a range in a run.
  [[nodiscard]] SpillPlace place_of(const Run& run, std::size_t range,
                                    std::size_t i) const noexcept {
    return {run.place.volume, run.place.offset + (run.starts[range] + i) * record_bytes_};
  }

  SpillFile& file_;
  Splitters splitters_;
  bool kept_;
  std::size_t record_bytes_;
  std::vector<Run> runs_;
};

/// Reads the records of one range in the order of the input. Records that were read leave the disk
/// unless the partition is kept, so the ranges of a partition must be read in ascending order.
/// Kept records are compared with their checksum at the end of each run's part of the range.
class BucketReader {
 public:
  BucketReader(std::shared_ptr<const Partition> partition, std::size_t range);

  /// Returns the number of records in the range.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// Returns the number of records not read yet.
  [[nodiscard]] std::uint64_t left() const noexcept { return left_; }
  /// Returns whether all records have the same key.
  [[nodiscard]] bool single_key() const noexcept;
  /// Returns the bytes of a record on disk.
  [[nodiscard]] std::size_t record_bytes() const noexcept { return partition_->record_bytes_; }
  /// Returns whether the partition is kept.
  [[nodiscard]] bool kept() const noexcept { return partition_->kept_; }
  /// Reads the next records into the front of `out`.
  /// @return  the number of records read; less than out.size() only at the end of the range
  /// @throws DataError when kept records are not what was written; std::system_error
  [[nodiscard]] std::size_t read(std::span<PointRecord> out, SpillReader& reader);
  /// Returns a sample of keys, drawn evenly from the whole range.
  /// @param count  keys wanted, at least 1; there are fewer when the range has fewer records
  [[nodiscard]] std::vector<MortonKey> sample(std::size_t count, SpillReader& reader) const;

 private:
  void verify(std::size_t run, std::size_t at, std::span<const PointRecord> records);

  std::shared_ptr<const Partition> partition_;
  std::size_t range_;
  std::uint64_t size_ = 0;
  std::uint64_t left_ = 0;
  std::size_t run_ = 0;       ///< the run to read on in
  std::size_t at_ = 0;        ///< the next record of the range in that run
  std::uint64_t digest_ = 0;  ///< checksum of the range's records in that run before at_
};

}  // namespace ptc
