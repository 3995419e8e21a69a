// Comparison of a file of points that was written with what was meant to be in it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/base/surfel.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/io/cloud/points.h"

namespace ptc {

/// What is known of one number of all points, such as nx or intensity.
struct ColumnFacts {
  std::uint64_t known = 0;    ///< points in which it is known
  std::uint64_t unknown = 0;  ///< points in which it is not
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  double sum = 0;
  double weighted = 0;  ///< sum of the values, each with a weight in [0, 1) that tells its place

  /// Adds the value of the next point. What floats cannot hold counts as unknown.
  void add(double value) noexcept;
  /// Returns the mean of the finite values; 0 when there are none.
  [[nodiscard]] double mean() const noexcept;
};

/// The facts of the columns of points: of the surfel under the names that PLY has for them, of
/// channels under those of row_channels().
class PointColumns {
 public:
  /// What is taken as the value of a channel.
  enum class Values : std::uint8_t {
    stored,  ///< its number
    meant    ///< its number with scale and offset, unless that stands for "not known"
  };

  PointColumns(std::span<const Channel> channels, Values values);
  void add_surfels(std::span<const Surfel> surfels);
  void add_rows(std::span<const std::byte> rows, std::size_t count);

  /// Returns the number of surfels that were added.
  [[nodiscard]] std::uint64_t points() const noexcept { return points_; }
  [[nodiscard]] const ColumnFacts& surfel(std::size_t column) const { return surfel_[column]; }
  /// A component of a channel.
  struct Part {
    const Channel* channel;
    const ColumnFacts* facts;
  };
  /// Returns a component by its name; nothing when there is none.
  [[nodiscard]] std::optional<Part> find(const std::string& name) const;

 private:
  Values values_;
  std::vector<RowChannel> channels_;
  std::size_t row_bytes_;
  std::uint64_t points_ = 0;
  std::vector<ColumnFacts> surfel_;
  std::vector<std::vector<ColumnFacts>> parts_;  // by channel and component
};

/// Compares the points that go into a file with those that come out of it.
///
/// The numbers of points must be equal. Of the numbers that a reader finds under the names that
/// they had, the least and the greatest value, the mean, and a mean with weights that tell points
/// apart must be those that were written, but for what the file rounds: a ten-thousandth of the
/// range, a step of LAS, 0.01 for normals and the albedo, and the last bits of floats. That finds
/// columns and points that are swapped, cut or of the wrong type or scale. Not compared are what a
/// format holds otherwise, such as fields of LAS or the colour `rgb`, and channels that the file
/// does not have under their names.
class WrittenCheck {
 public:
  WrittenCheck(OutputFormat format, const PointWriteInfo& info);
  /// Adds points that were written.
  void add(std::span<const Surfel> surfels, std::span<const std::byte> rows);
  /// Reads the file and compares it. USD files, which are not read, pass.
  /// @param progress  is advanced by the points that were read
  /// @return the channels that the file does not have under their names, which were not compared;
  ///         none of those that a format holds otherwise, such as bytes of a colour
  /// @throws DataError that names the file and the number that differs; as open_points()
  [[nodiscard]] std::vector<std::string> compare(const std::filesystem::path& target,
                                                 Progress& progress) const;

 private:
  [[nodiscard]] bool is_read() const noexcept;
  void compare_surfels(const std::filesystem::path& target, const PointFileInfo& file,
                       const PointColumns& read) const;
  [[nodiscard]] bool compare_channel(const std::filesystem::path& target, const RowChannel& row,
                                     const PointColumns& read) const;
  [[nodiscard]] bool is_held_otherwise(const RowChannel& row) const;

  OutputFormat format_;
  PointWriteInfo info_;
  PointColumns stored_;
  std::optional<PointColumns> meant_;  // of channels, where that differs from what is stored
};

}  // namespace ptc
