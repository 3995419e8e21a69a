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
#include "engine/io/file/state_file.h"
#include "engine/sort/direct_file.h"
#include "engine/sort/splitters.h"
#include "engine/sort/transfers.h"
#include "format/point_record.h"

namespace ptc {

/// Bytes of a record on the disk: all that are not reserved.
inline constexpr std::size_t kSpilledBytes = offsetof(PointRecord, reserved);

/// Where records lie.
struct SpillPlace {
  std::uint32_t volume = 0;
  std::uint64_t offset = 0;  ///< bytes
};

/// Temporary files of records, one volume in each of several directories. Threads: one appends,
/// others may read and discard what it has appended.
class SpillFile {
 public:
  /// @param directories  at least one
  /// @throws std::system_error naming the directory
  explicit SpillFile(std::span<const std::filesystem::path> directories);
  /// Volumes with names, which stay; one that is there already is overwritten.
  [[nodiscard]] static SpillFile named(std::span<const std::filesystem::path> names);
  /// Those of which save() told. @throws DataError when they are not what they were,
  /// std::system_error
  [[nodiscard]] static SpillFile reopened(StateReader& state);
  /// Puts volumes with names on the disk, and tells what there is in them.
  void save(StateWriter& state);

  /// Writes records to the volume that this leaves least full, by its directory's room; when there
  /// is none left, to the others.
  /// @param packed  kSpilledBytes of each, at an address that is a multiple of kDirectBytes, in
  /// memory that can be read up
  ///                to the next such multiple behind them
  /// @return  their place, its offset a multiple of kDirectBytes
  /// @throws std::system_error naming the directory
  [[nodiscard]] SpillPlace append(std::span<const std::byte> packed);
  /// True when what was appended has so many bytes there.
  [[nodiscard]] bool holds(const SpillPlace& place, std::uint64_t bytes) const noexcept;
  void read_at(const SpillPlace& place, std::span<std::byte> bytes) const;
  /// @throws DataError: so many points there are not what was written
  [[noreturn]] void refuse(const SpillPlace& place, std::size_t points) const;
  /// Gives back the disk's blocks that end in these bytes, which are not read again, nor those in
  /// front of them in their first block.
  void discard(const SpillPlace& place, std::uint64_t bytes) const noexcept;
  /// Bytes appended so far.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  struct Volume {
    explicit Volume(const std::filesystem::path& directory) : place(directory), file(directory) {}
    Volume(const std::filesystem::path& name, DirectFile::Kept how, std::uint64_t bytes)
        : place(name), file(name, how), end(bytes) {}
    std::filesystem::path place;  ///< the directory, or the file when it has a name
    DirectFile file;
    std::atomic<std::uint64_t> end{0};
  };
  SpillFile() = default;
  /// Numbers of the volumes, those first that so many bytes leave least full.
  [[nodiscard]] std::vector<std::uint32_t> by_room(std::uint64_t bytes) const;

  std::vector<std::unique_ptr<Volume>> volumes_;
};

/// Reads from any offset of SpillFiles, several pieces at once, through memory of its own.
class SpillReader {
 public:
  /// Consecutive records in the file and where they go.
  struct Piece {
    SpillPlace place;
    std::span<PointRecord> out;
  };

  /// @param buffer_bytes  of all reads that run at once, at least kMinBytes
  explicit SpillReader(std::size_t buffer_bytes);
  void read(const SpillFile& file, std::span<const Piece> pieces);

  static constexpr std::size_t kMinBytes = kTransfers * 2 * kDirectBytes;

 private:
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
  /// @param kept  what is read stays on the disk until it is discarded
  Partition(SpillFile& file, Splitters splitters, bool kept = false);
  /// As save() wrote it, kept. @throws DataError
  Partition(SpillFile& file, StateReader& state);
  void save(StateWriter& state) const;

  /// Where each range begins in a run, and the end.
  using Starts = std::vector<std::uint32_t>;

  /// Fills the front of `range_of` with the numbers of the ranges that records lie in. Threads: any
  /// time.
  void find_ranges(std::span<const PointRecord> records,
                   std::span<std::uint16_t> range_of) const noexcept;
  void find_ranges(std::span<const PointRecord> records, std::span<std::uint16_t> range_of,
                   const Executor& executor) const;
  /// Groups what goes to the disk of a run, stable. Threads: while another run is written, too.
  /// @param range_of  each record's range
  /// @param grouped   for kSpilledBytes of each
  [[nodiscard]] Starts group_run(std::span<const PointRecord> records,
                                 std::span<const std::uint16_t> range_of,
                                 std::span<std::byte> grouped, const Executor& executor) const;
  /// Writes what group_run() has grouped, as SpillFile::append(). Runs come in the order of the
  /// input.
  void write_run(std::span<const std::byte> grouped, Starts starts);

  [[nodiscard]] std::size_t ranges() const noexcept { return splitters_.size(); }
  /// Records of a range.
  [[nodiscard]] std::uint64_t size(std::size_t range) const noexcept;
  /// Gives back the disk of a range; ranges go by ascending number.
  void discard(std::size_t range) const noexcept;

 private:
  friend class BucketReader;
  struct Run {
    SpillPlace place;
    Starts starts;
    std::vector<std::uint64_t> digests;  // of each range in the run, when kept: a power cut may
                                         // tear what is to be on the disk

    [[nodiscard]] std::size_t size(std::size_t range) const noexcept {
      return starts[range + 1] - starts[range];
    }
    [[nodiscard]] SpillPlace place_of(std::size_t range, std::size_t i) const noexcept {
      return {place.volume, place.offset + (starts[range] + i) * kSpilledBytes};
    }
  };

  SpillFile& file_;
  Splitters splitters_;
  bool kept_;
  std::vector<Run> runs_;
};

/// Reads the records of one range in the order of the input. What was read leaves the disk unless
/// it is kept: ranges of a partition are read by ascending number. What is kept is compared with
/// what was written, run by run, when all of the range there was read.
class BucketReader {
 public:
  BucketReader(std::shared_ptr<const Partition> partition, std::size_t range);

  /// How many there are.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// How many were not read yet.
  [[nodiscard]] std::uint64_t left() const noexcept { return left_; }
  /// True when all have the same key.
  [[nodiscard]] bool single_key() const noexcept;
  [[nodiscard]] bool kept() const noexcept { return partition_->kept_; }
  /// Fills the front of `out`. @return how many. @throws DataError when what is kept is not what
  /// was written
  [[nodiscard]] std::size_t read(std::span<PointRecord> out, SpillReader& reader);
  /// `count` keys, at least 1, from all parts of the range.
  [[nodiscard]] std::vector<MortonKey> sample(std::size_t count, SpillReader& reader) const;

 private:
  void verify(std::size_t run, std::size_t at, std::span<const PointRecord> records);

  std::shared_ptr<const Partition> partition_;
  std::size_t range_;
  std::uint64_t size_ = 0;
  std::uint64_t left_ = 0;
  std::size_t run_ = 0;       // where to read on
  std::size_t at_ = 0;        // in that run's part
  std::uint64_t digest_ = 0;  // of what was read of that part
};

}  // namespace ptc
