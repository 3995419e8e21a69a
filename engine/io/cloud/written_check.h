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

#include "engine/base/surfel.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/io/cloud/points.h"

namespace ptc {

/// What is known of one number of all points, such as nx or intensity.
struct ColumnFacts {
  std::uint64_t known = 0;    ///< points in which it is finite
  std::uint64_t unknown = 0;  ///< points in which it is not
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  double sum = 0;

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
  void add(std::span<const Surfel> surfels, std::span<const std::byte> rows);

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
/// The numbers of points must be equal. Of every number that a reader finds under the name that it
/// had, the least and the greatest value and the mean must be those that were written, but for what
/// the type of the file rounds: at most a ten-thousandth of its range, a hundredth for normals and
/// colours. That finds columns that are missing, swapped, cut or of the wrong type or scale.
class WrittenCheck {
 public:
  WrittenCheck(OutputFormat format, const PointWriteInfo& info);
  /// Adds points that were written.
  void add(std::span<const Surfel> surfels, std::span<const std::byte> rows);
  /// Reads the file and compares it. USD files, which are not read, pass.
  /// @return the channels that the file does not have under their names, which were not compared;
  ///         none of those that a format holds otherwise, such as bytes of a colour
  /// @throws DataError that names the file and the number that differs; as open_points()
  [[nodiscard]] std::vector<std::string> compare(const std::filesystem::path& target) const;

 private:
  [[nodiscard]] bool is_read() const noexcept;
  void compare_surfels(const std::filesystem::path& target, const PointFileInfo& file,
                       const PointColumns& read) const;
  [[nodiscard]] bool compare_channel(const std::filesystem::path& target, const RowChannel& row,
                                     const PointColumns& read) const;
  [[nodiscard]] bool is_held_otherwise(const Channel& channel) const;

  OutputFormat format_;
  PointWriteInfo info_;
  PointColumns stored_;
  std::optional<PointColumns> meant_;  // where that differs from what is stored
};

}  // namespace ptc
