// External Morton sort under a memory cap.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/memory.h"
#include "engine/base/stream.h"
#include "engine/io/file/state_file.h"
#include "engine/sort/records_digest.h"
#include "engine/sort/sort_plan.h"
#include "engine/sort/spill.h"
#include "format/point_record.h"

namespace ptc {

/// What a sort may use: memory, directories, and what is known of its input.
struct SortOptions {
  /// The cap on all memory of the sort; at least 256 KiB. Memory that the sort has no use for is
  /// not touched: see plan_sort().
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  /// The directories of temporary files, at least one. What is spilled is spread over them.
  std::vector<std::filesystem::path> temp_dirs{"."};
  /// The approximate number of records; 0: unknown. Records that are known not to fit in memory are
  /// spilled earlier, in as many ranges as let each range fit.
  std::uint64_t expected = 0;
  /// Whether records may have emission; without it, the emission of a record that is spilled is
  /// lost.
  bool emits = false;
  /// Keeps the memory when all records were handed out, for ExternalSorter::restart().
  bool restarts = false;
  /// The names of the temporary files, which then are kept and hold all records, even those that
  /// would fit in memory. Empty: the files have no names.
  std::vector<std::filesystem::path> kept_files;
};

/// What a sort did so far.
struct SortStatistics {
  std::uint64_t points = 0;         ///< records that were added
  std::uint64_t spilled_bytes = 0;  ///< bytes written to temporary files; 0 when all fit in memory
  std::uint32_t buckets = 0;  ///< buckets sorted and handed out so far; 1 when all fit in memory
};

/// Sorts records by key. Records with equal keys stay in the order in which they came, so the
/// result depends on neither the cap nor the threads.
///
/// Records collect in memory until it is full. More are partitioned on disk into ranges, by
/// splitters that come from the sample, and each range (a bucket) is radix-sorted in memory: while
/// one bucket is handed out, the next is sorted, and the one after that is read. A bucket that is
/// larger than memory is partitioned again. The temporary files have no names and vanish with the
/// sorter, unless SortOptions::kept_files names them.
///
///     add()   memory | a | b | grouped | written |  -> files by range
///     next()  files by range -> | read | sorted | handed out |
///
/// Threads: add() and the stream's next() are called from outside the loops of the executor.
class ExternalSorter {
 public:
  /// @param executor  must outlive the sorter
  /// @param sample    keys drawn evenly from the input, in any order; a few thousand are enough.
  ///                  With fewer than 64, the first records that fill the memory are the sample
  /// @throws std::invalid_argument when the cap is below 256 KiB; std::bad_alloc; std::system_error
  ///         (ENOSPC) when the directories have no room for the expected records
  ExternalSorter(const SortOptions& options, const Executor& executor,
                 std::span<const MortonKey> sample);
  /// Resumes from the kept files of an earlier sorter. Nothing can be added; the digest and the
  /// statistics are those of the earlier one.
  /// @param kept  what keep() wrote, read to its end
  /// @throws DataError when the files are not as they were, also from what finish() returns;
  ///         std::system_error
  ExternalSorter(const SortOptions& options, const Executor& executor, StateReader& kept);
  ExternalSorter(const ExternalSorter&) = delete;
  ExternalSorter& operator=(const ExternalSorter&) = delete;

  /// The bytes of temporary files that the expected records take; 0 when they fit in memory.
  [[nodiscard]] std::uint64_t expected_spill() const noexcept;
  /// The bytes that a record takes in a temporary file.
  [[nodiscard]] std::size_t record_bytes() const noexcept {
    return options_.emits ? kEmittingBytes : kSpilledBytes;
  }
  /// Adds records.
  /// @throws std::system_error naming the directory when records cannot be spilled, now or in the
  ///         background since an earlier call; the sorter is then of no further use
  void add(std::span<const PointRecord> records);
  /// The digest of all records so far.
  [[nodiscard]] RecordsDigest digest() const noexcept { return digest_; }
  /// Spills all records to the kept files and writes what another process needs to resume from
  /// them. Nothing may be added afterwards.
  /// @throws as add()
  void keep(StateWriter& state);
  /// Gives back the disk space of the kept buckets that lie entirely before a record.
  /// @param record  number in sorted order
  /// Threads: safe while others read the stream.
  void discard_before(std::uint64_t record);
  /// Returns the sorted stream, which this sorter must outlive. Nothing may be added afterwards.
  /// The memory is released when the last record has been handed out, unless
  /// SortOptions::restarts.
  /// @param first  the number of the first record in sorted order; above 0 only with kept files
  /// @throws as add(); so does the stream's next()
  [[nodiscard]] std::unique_ptr<PointStream> finish(std::uint64_t first = 0);
  /// Begins anew without records. Memory that was used before need not be cleared by the system.
  /// @param expected  as SortOptions::expected, and not more than that of the first time
  /// @param sample    as for the constructor, of the records that will come
  /// @pre SortOptions::restarts, no kept files; what finish() returned is gone
  void restart(std::uint64_t expected, std::span<const MortonKey> sample);
  [[nodiscard]] SortStatistics statistics() const noexcept;

 private:
  // Memory is two runs. They serve as one run and its scratch while all may fit, then as four
  // parts: two that are filled in turn, and two that records are grouped into and written from.
  [[nodiscard]] std::span<PointRecord> memory() noexcept;
  [[nodiscard]] std::span<PointRecord> scratch() noexcept;
  [[nodiscard]] std::span<PointRecord> part(std::size_t k) noexcept;
  [[nodiscard]] std::size_t part_records() noexcept { return memory().size() / 4; }
  [[nodiscard]] std::span<std::uint16_t> ranges_of(std::span<const PointRecord> records) noexcept;

  void begin(std::span<const MortonKey> sample);
  void release_memory() noexcept;
  void take(std::span<const PointRecord> records);
  void begin_partition();
  void spill();
  void spill_all();
  [[nodiscard]] std::unique_ptr<PointStream> stream_memory();
  [[nodiscard]] std::unique_ptr<PointStream> stream_buckets(std::uint64_t first);

  SortOptions options_;
  const Executor& executor_;
  SortPlan plan_;
  std::vector<MortonKey> sample_;
  Arena arena_;
  std::span<PointRecord> filling_;       ///< a run, or a part() once not all records will fit
  std::size_t filled_ = 0;               ///< records there
  std::vector<std::uint16_t> range_of_;  ///< the range of each record of the first run
  bool kept_ = false;                    ///< the temporary files have names and stay
  std::uint64_t points_ = 0;
  RecordsDigest digest_{};
  bool finished_ = false;
  std::optional<SpillFile> file_;  ///< set from the first spill on, or with kept files
  std::shared_ptr<Partition> partition_;
  std::optional<SpillFile> nested_;     ///< kept files' buckets that are partitioned again
  std::size_t discarded_ = 0;           ///< ranges of kept files
  std::uint64_t discarded_points_ = 0;  ///< records of those ranges
  std::atomic<std::uint32_t> buckets_{0};
  std::size_t turn_ = 0;  ///< which of the two grouping parts is next
  // The background work comes last, so that its end is awaited before the other members go.
  std::shared_future<Partition::Starts> grouping_;   ///< of what was filled before
  std::array<std::shared_future<void>, 2> writing_;  ///< of what was grouped into either part
};

}  // namespace ptc
