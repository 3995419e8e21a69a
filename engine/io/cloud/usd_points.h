// Internal to the writers of USD: the attributes of a prim of type Points, as columns.
//
//   points | normals | widths | primvars:displayColor | primvars:NAME ...      one array for each
//
// USD stores whole arrays, but points come one after another. As their number is known, each column
// has a place in a file from the start, and all of them grow side by side:
//
//   | points: aaaa....... | normals: bbbb....... | widths: cc.... |
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/point_rows.h"

namespace ptc {

/// What the numbers of a column are.
enum class UsdSource : std::uint8_t {
  position,
  normal,
  width,
  colour,
  radiance,
  emission,
  albedo,
  channel
};

/// An attribute with a value for each point.
struct UsdColumn {
  std::string name;  ///< of the attribute, such as "primvars:occlusion"
  std::string type;  ///< of a value, such as "color3f"
  UsdSource source{};
  ChannelType number = ChannelType::f32;  ///< type of each number: i32, u32, i64, u64, f32, f64
  std::size_t numbers = 1;                ///< of a value
  ChannelType from = ChannelType::f32;    ///< of a channel: the type in the rows
  std::size_t row_offset = 0;             ///< of a channel: bytes from the start of a row
  std::uint64_t begin = 0;                ///< where the column lies in its file

  /// Returns the bytes of a value.
  [[nodiscard]] std::size_t value_bytes() const noexcept { return numbers * channel_bytes(number); }
};

/// The facts about a stage that do not follow from its points.
struct UsdStage {
  char up = 'Y';  ///< Y or Z
  std::optional<double> metres_per_unit;
  std::optional<glm::dvec3> translation;  ///< added to all points
};

/// Returns the facts about a stage. Positions are floats, so points far from the origin are written
/// relative to the middle of their bounds, and a translation moves them back.
[[nodiscard]] UsdStage usd_stage(const PointWriteInfo& info);

/// A writer that fills columns.
class UsdWriter : public CheckedWriter {
 protected:
  /// @param begin  where the columns begin in their file
  /// @param lead   bytes that each column leaves free in front of it; it begins at a multiple of 8
  UsdWriter(const PointWriteInfo& info, std::uint64_t begin, std::uint64_t lead);

  [[nodiscard]] const UsdStage& stage() const noexcept { return stage_; }
  [[nodiscard]] const std::vector<UsdColumn>& columns() const noexcept { return columns_; }
  /// Returns where the last column ends.
  [[nodiscard]] std::uint64_t columns_end() const noexcept { return end_; }
  /// Writes what is left in the buffers.
  void flush();
  /// Returns the box that holds all discs, relative to the translation: its low and its high
  /// corner.
  [[nodiscard]] std::vector<glm::vec3> extent() const;

 private:
  /// Writes bytes of the columns.
  virtual void store(std::uint64_t offset, std::span<const std::byte> bytes) = 0;

  void put(const Surfel& surfel, const std::byte* row) final;
  void add_columns(const PointWriteInfo& info);
  void add_channel(const RowChannel& row);
  void add(UsdColumn column);
  void append(const UsdColumn& column, const Surfel& surfel, const std::byte* row,
              std::vector<std::byte>& out) const;
  [[nodiscard]] glm::vec3 triple(UsdSource source, const Surfel& surfel,
                                 const std::byte* row) const;
  [[nodiscard]] glm::vec3 relative(const Surfel& surfel) const;  // its place, from the translation
  void flush(std::size_t column);

  UsdStage stage_;
  DisplayColour colour_;
  std::vector<UsdColumn> columns_;
  std::vector<std::vector<std::byte>> buffers_;  // of each column, what is not stored yet
  std::vector<std::uint64_t> stored_;            // of each column, bytes
  std::uint64_t end_;
  std::uint64_t lead_;
  Bounds box_;  // of the positions that were written
  float most_radius_ = 0;
};

}  // namespace ptc
