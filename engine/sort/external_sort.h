// External Morton sort under a memory cap.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "engine/io/file/state_file.h"
#include "format/point_record.h"

namespace ptc {

/// Reads past so many points of a stream, or to its end.
void pass_over(PointStream& points, std::uint64_t count);

struct SortOptions {
  /// All that this stage holds at once; at least 256 KiB. What is of no use is not touched: see
  /// plan_sort().
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  std::vector<std::filesystem::path> temp_dirs{
      "."};  ///< at least one; what is spilled is spread over them
  /// About how many records will come; 0: not known. Those that are known not to fit leave for the
  /// disk sooner, in as many ranges as let each fit.
  std::uint64_t expected = 0;
  /// Names of the temporary files, which then stay and hold all records, whatever fits in memory;
  /// empty: they have none.
  std::vector<std::filesystem::path> kept_files;
};

struct SortStatistics {
  std::uint64_t points = 0;
  std::uint64_t spilled_bytes = 0;  ///< written to temporary files, 0 when all fit in memory
  std::uint32_t buckets = 0;  ///< sorted one by one and handed out so far, 1 when all fit in memory
};

/// Sorts records by key; equal keys stay in the order in which they came, so the result depends on
/// neither cap nor threads.
///
/// Records collect in memory while there is little of them; more are partitioned on disk by
/// splitters taken from the sample, and each bucket is radix-sorted in memory: while one is handed
/// out the next is sorted and the one after it read. A bucket that turns out larger than memory is
/// partitioned again. The temporary files have no names and vanish with the sorter. Threads: add()
/// and next() are called from outside the bodies of the executor's loops.
class ExternalSorter {
 public:
  /// @param executor  must outlive the sorter
  /// @param sample    keys drawn evenly from the input, any order; a few thousand are enough; with
  ///                  fewer than 64 the first records that fill the memory serve instead
  /// @throws std::invalid_argument when the cap is too small, std::bad_alloc; std::system_error
  /// (ENOSPC)
  ///         when the directories have no room for what is expected
  ExternalSorter(const SortOptions& options, const Executor& executor,
                 std::span<const MortonKey> sample);
  /// Goes on with the files of a sorter that was kept; nothing can be added. Its digest and
  /// statistics are known.
  /// @param kept  from keep(), read to its end
  /// @throws DataError when files or table are not what they were, also later by what finish()
  /// gives; std::system_error
  ExternalSorter(const SortOptions& options, const Executor& executor, StateReader& kept);
  ~ExternalSorter();

  /// Bytes of temporary files that what is expected takes; 0 when it fits in memory.
  [[nodiscard]] std::uint64_t expected_spill() const noexcept;
  /// @param records  their reserved bytes 0
  /// @throws std::system_error naming the directory when what memory does not hold cannot be
  /// written, now or a moment ago: the sorter is of no use then
  void add(std::span<const PointRecord> records);
  /// Order-independent digest of all records so far: the same set gives the same value.
  [[nodiscard]] std::array<std::uint64_t, 2> digest() const noexcept;
  /// Of a sorter with kept_files: puts all records on the disk, and adds to `state` what another
  /// process needs to go on with them. Nothing may be added afterwards. @throws as add()
  void keep(StateWriter& state);
  /// Gives back the disk of kept records before the one of this number in sorted order, as far as
  /// the buckets go that lie whole before it. Threads: while others read the stream, too.
  void discard_before(std::uint64_t record);
  /// The sorted stream; this must outlive it. Nothing may be added afterwards. Its memory is given
  /// back when it has handed out all. @throws as add(); so does the stream's next()
  /// @param first  record to begin with; more than 0 when what is before was kept
  [[nodiscard]] std::unique_ptr<PointStream> finish(std::uint64_t first = 0);
  [[nodiscard]] SortStatistics statistics() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Stable in-memory sort by key: MSD radix, then insertion for small pieces. All 128 bits of a key
/// count. Time: linear for keys spread evenly, at worst a pass for each bit of a key.
/// @param scratch  as many records as `records`; what it holds afterwards is of no use
/// @throws std::invalid_argument when it is smaller, std::bad_alloc
void radix_sort(std::span<PointRecord> records, std::span<PointRecord> scratch,
                const Executor& executor);

}  // namespace ptc
