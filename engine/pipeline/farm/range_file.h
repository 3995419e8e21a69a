// The points that a task of a farm has sorted into ranges of the curve, in one file.
//
//   block | block | ... | rows of range 0, of range 1, ... | index: an entry for each range | end
//
// A row has offset, points and checksum of a block. An entry has the first row of a range, the
// checksum of its rows, and the digests of its points. Who wants some ranges reads their entries,
// their rows and their blocks, however many others there are.
//
// Blocks begin at multiples of kDirectBytes and pass by the page cache: they are read once, by
// other machines. A file system that has no direct transfers gets usual ones.
//
// A block has points of one range. The blocks of a range, in the order of the file, are its points
// in the order of the input: first the records, then the values of each group of channels.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <future>
#include <span>
#include <vector>

#include "engine/base/memory.h"
#include "engine/io/file/file.h"
#include "engine/sort/direct_file.h"
#include "engine/sort/records_digest.h"
#include "format/morton.h"
#include "format/point_record.h"

namespace ptc {

/// The bytes of a point in a block: its record, and its values in each group of channels.
struct RangeRow {
  std::vector<std::size_t> group_bytes;
  /// Returns the bytes of a point.
  [[nodiscard]] std::size_t bytes() const noexcept;
};

/// A block of the file.
struct RangeBlock {
  std::uint32_t range = 0;
  std::uint64_t offset = 0;  ///< bytes from the start of the file
  std::uint64_t points = 0;
  std::uint64_t xxh3 = 0;  ///< of its bytes
};

/// The blocks of some ranges.
struct RangeBlocks {
  std::vector<RangeBlock> blocks;  ///< range by range, in the order of the file
  /// The digest of the points of all blocks, and then one for each group of channels: of the values
  /// of these points, each with the key of its point.
  std::vector<RecordsDigest> digests;
};

/// Writes the points of an input by range.
/// Memory: `memory_bytes`, and kTableBytes for each block; block_points() says how large these are.
class RangeWriter {
 public:
  /// @param target  appears whole, when finish() is called
  /// @param plan    identity of the plan
  /// @param cuts    where ranges begin, but for the first; ascending
  /// @throws std::system_error; std::invalid_argument when the memory is too small for the ranges
  RangeWriter(const std::filesystem::path& target, std::uint64_t plan,
              std::span<const MortonKey> cuts, RangeRow row, std::uint64_t memory_bytes);

  /// Adds points.
  /// @param values  for each group, records with the values of the points
  void add(std::span<const PointRecord> points, std::span<const std::vector<PointRecord>> values);
  /// Writes what is left and publishes the file.
  void finish();

  /// The memory of a block in the table, bytes, with what its vector grows ahead.
  static constexpr std::uint64_t kTableBytes = 2 * sizeof(RangeBlock);
  /// Returns the number of points in a full block.
  [[nodiscard]] static std::size_t block_points(std::size_t ranges, const RangeRow& row,
                                                std::uint64_t memory_bytes);
  /// The least memory that a number of ranges needs, bytes.
  [[nodiscard]] static std::uint64_t least_memory(std::size_t ranges, const RangeRow& row);

 private:
  struct Open {
    std::vector<PointRecord> points;
    std::vector<std::byte> values;       ///< group after group, each with room for a whole block
    std::vector<RecordsDigest> digests;  ///< RangeBlocks::digests of the blocks that were written
  };

  [[nodiscard]] std::size_t range_of(const MortonKey& key) const;
  void flush(std::size_t range);
  void write(std::span<const std::byte> bytes);
  void write_table();

  std::filesystem::path target_, partial_;
  TemporaryName temporary_;  ///< removes what was not published
  DirectFile file_;
  std::uint64_t end_ = 0;  ///< of what was written
  std::uint64_t plan_;
  std::vector<MortonKey> cuts_;
  RangeRow row_;
  std::size_t block_points_;
  std::vector<Open> open_;
  std::size_t last_ = 0;  ///< range of the last point: the next one is often in it, too
  std::vector<PointRecord> unpacked_;  ///< values of a block, for their digest
  std::array<Arena, 2> packed_;        ///< a block on its way to the file, and the one before
  std::size_t turn_ = 0;
  std::vector<RangeBlock> blocks_;
  std::future<void> writing_;  ///< last, so that its end is awaited before the other members go
};

/// Returns the blocks of some ranges.
/// @param first, end  numbers of the first range, and of the one behind the last
/// @throws DataError when the file is damaged or of another plan; std::system_error
[[nodiscard]] RangeBlocks read_ranges(const std::filesystem::path& path, std::uint64_t plan,
                                      const RangeRow& row, std::size_t first, std::size_t end);

/// Reads the points of some blocks.
class RangeReader {
 public:
  /// @param blocks  some of read_ranges(); they must outlive this
  /// @throws std::system_error
  RangeReader(const std::filesystem::path& path, RangeRow row, std::span<const RangeBlock> blocks);

  /// Reads the next block. @return whether there was one
  /// @throws DataError when it is damaged, or has a point that a container cannot hold
  [[nodiscard]] bool next();
  /// The points of the block, until the next one is read.
  [[nodiscard]] std::span<const PointRecord> block() const noexcept { return points_; }
  /// Writes the values of a group into records that have the keys of the block's points.
  void values(std::size_t group, std::vector<PointRecord>& records) const;

  /// Appends keys from pieces of the blocks, without checking these: to know about how the points
  /// are spread, a part need not read all of them. There is no block afterwards.
  /// @param first  points from the first one to the first piece
  /// @param every  points from one piece to the next, 1 or more
  /// @return       points from the end of the blocks to the next piece: `first` for another file
  [[nodiscard]] std::uint64_t sample_keys(std::uint64_t first, std::uint64_t every,
                                          std::vector<MortonKey>& keys);

 private:
  std::filesystem::path path_;
  DirectFile file_;
  RangeRow row_;
  std::span<const RangeBlock> blocks_;
  std::size_t at_ = 0;
  Arena bytes_;
  std::span<const PointRecord> points_;  ///< in bytes_
};

}  // namespace ptc
