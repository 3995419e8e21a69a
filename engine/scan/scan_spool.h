// The points of a scan on disk: every record, and every distinct position once.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "engine/base/stream.h"
#include "engine/io/file/file.h"
#include "engine/scan/place_index.h"
#include "format/morton.h"
#include "format/point_record.h"

namespace ptc {

/// A distinct position of the cloud, called a place. Points that coincide share a place, which has
/// the normal of the first of them.
struct Place {
  MortonKey key;
  std::uint32_t normal = 0;  ///< octahedral u and v, or the scanner's number if it is unknown
  std::uint32_t unknown_normal = 0;  ///< 1 when the normal is unknown, otherwise 0
};
static_assert(sizeof(Place) == 24 && std::is_trivially_copyable_v<Place>);

/// Two temporary files without names: the records in their order, and the places in theirs.
///
/// All records are given to add_records() and to add_places(), block by block.
///
/// Threads: one may call add_records() while another calls add_places(). After finish(), const
/// calls may be made concurrently.
class ScanSpool {
 public:
  /// @param directories  of temporary files, at least one
  /// @param index_bytes  memory for the index, at least 64 KiB
  /// @throws std::system_error that names the directory
  ScanSpool(const std::vector<std::filesystem::path>& directories, std::uint64_t index_bytes);

  /// Adds the next records, sorted by key. @throws std::system_error
  void add_records(std::span<const PointRecord> records);
  /// Adds the places of the next records, sorted by key. @throws std::system_error
  void add_places(std::span<const PointRecord> records);
  /// Writes what is still in memory, and completes the index. @throws std::system_error
  void finish();

  [[nodiscard]] std::uint64_t records() const noexcept { return records_; }
  [[nodiscard]] std::uint64_t places() const noexcept { return index_.places(); }
  [[nodiscard]] const PlaceIndex& index() const noexcept { return index_; }

  /// Fills `out` with the records from number `first` on. @throws std::system_error, DataError
  void read_records(std::uint64_t first, std::span<PointRecord> out) const;
  /// Fills `out` with the places from number `first` on. @throws std::system_error, DataError
  void read_places(std::uint64_t first, std::span<Place> out) const;
  /// Gives back the disk space of the places, which are then gone.
  void discard_places() noexcept;

 private:
  void write_places();

  TempFile record_file_, place_file_;
  std::uint64_t records_ = 0;
  std::uint64_t places_written_ = 0;
  std::vector<Place> pending_;  ///< places that are not written yet
  MortonKey last_;              ///< key of the last place, if there is one
  PlaceIndex index_;
};

/// Returns the lattice position of a key.
[[nodiscard]] inline LatticePosition position_of(const MortonKey& key) noexcept {
  const LatticePoint q = decode_morton(key);
  return {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2])};
}

}  // namespace ptc
