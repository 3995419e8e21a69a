// What the completion of a scan says of single points: marks, on their way to a channel.
//
// A mark travels in PointRecord::flags from the scan through later stages. A tap takes it out
// before the octree is built, in whose pages flags are 0.
//
//   complete_scan --> marked_points --> merge, unique --> PointMarks::tap --> round, build
//                     flags = mark                          | flags = 0
//                                                           '--> temporary file --> put_into()
//
// Inputs may have these channels already, as points do that were shaded and written before. Marks
// then go into them, and points without a mark keep what they had.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/stream.h"
#include "engine/io/file/file.h"
#include "engine/scan/scan.h"
#include "engine/store/writer.h"
#include "format/schema.h"

namespace ptc {

/// The name of the channel that is 1 for points far from all others, else 0.
inline constexpr const char* kOutlierChannel = "outlier";
/// The name of the channel that says how far a receiver must rise above a point to stand clear of
/// the noise of its surface, in eighths of the point's radius.
inline constexpr const char* kRiseChannel = "rise";

/// Says whether a channel is of the kind that marks make. Points without a mark have 0 in it, which
/// is what marks mean by it.
[[nodiscard]] bool holds_marks(const Channel& channel);

/// Adds those of these channels that a record lacks, in a group of their own behind all others, if
/// there is one left.
void add_marks(Meta& meta);

/// Returns the groups that must be read for the rises of points: one, or none where a container has
/// no such channel.
[[nodiscard]] std::vector<std::uint8_t> rise_groups(std::span<const Channel> channels);

/// Where the rise of a point lies in a row of its channels.
class RisePlace {
 public:
  /// Looks for the channel. @param channels  of a row
  explicit RisePlace(std::span<const Channel> channels);

  /// Returns how far a receiver must rise above a point, in radii; 0 without the channel.
  /// @param row  of the point
  [[nodiscard]] float radii(const std::byte* row) const noexcept {
    return offset_ ? 0.125F * static_cast<float>(std::to_integer<unsigned>(row[*offset_])) : 0;
  }

 private:
  std::optional<std::size_t> offset_;  ///< empty: there is no such channel
};

/// Yields the points of a completed scan with their marks as flags.
[[nodiscard]] std::unique_ptr<PointStream> marked_points(std::unique_ptr<ScanStream> scan);

/// Yields the points of a stream without those whose key is that of the point before.
/// @param sorted  must outlive the result
[[nodiscard]] std::unique_ptr<PointStream> unique_points(PointStream& sorted);

/// Keeps the marks of a stream, a byte for each point, in a temporary file.
class PointMarks {
 public:
  explicit PointMarks(const std::filesystem::path& directory) : file_(directory) {}

  /// Yields the points of a stream with flags of 0, and keeps their marks.
  /// @param points  must outlive the result, as must this object
  [[nodiscard]] std::unique_ptr<PointStream> tap(PointStream& points);
  /// Yields the values of a group of channels, with the marks in the channels that are theirs.
  /// @param values    of the same points; null: they have none but marks
  /// @param channels  of the file
  [[nodiscard]] std::unique_ptr<PointStream> put_into(PointStream* values, std::uint8_t group,
                                                      std::span<const Channel> channels) const;

 private:
  TempFile file_;
};

}  // namespace ptc
