// Internal to the reader of PCD: the header. Source: the documentation of the Point Cloud Library,
// "The PCD (Point Cloud Data) file format", versions 0.5 to 0.7.
//
//   # .PCD v0.7 - Point Cloud Data file format
//   VERSION 0.7
//   FIELDS x y z rgb           names
//   SIZE 4 4 4 4               bytes of a number
//   TYPE F F F F               I signed, U unsigned, F floating point
//   COUNT 1 1 1 1              numbers in each field
//   WIDTH 640                  columns of an organised cloud
//   HEIGHT 480                 its rows; 1 when the cloud has no order
//   VIEWPOINT 0 0 0 1 0 0 0    where the scanner stood, and a quaternion
//   POINTS 307200
//   DATA binary_compressed     or ascii, or binary; the points follow
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"
#include "format/schema.h"

namespace ptc {

/// How the points of a PCD file are stored.
enum class PcdData { ascii, binary, compressed };

/// A field of the points of a PCD file.
struct PcdField {
  std::string name;
  ChannelType type = ChannelType::f32;
  std::size_t count = 1;  ///< numbers in each point

  /// Returns the bytes that it takes in a binary point.
  [[nodiscard]] std::size_t bytes() const noexcept { return count * channel_bytes(type); }
};

/// The header of a PCD file.
struct PcdHeader {
  std::vector<PcdField> fields;
  std::uint64_t width = 0;
  std::uint64_t height = 1;
  std::uint64_t points = 0;  ///< width x height
  /// Position and quaternion (w x y z) of the scanner; nothing when the file has none.
  std::optional<std::array<double, 7>> viewpoint;
  PcdData data = PcdData::ascii;
  std::size_t point_bytes = 0;  ///< of a binary point, at most kMaxPcdPointBytes
};

/// The key of the text that keeps the viewpoint of a file for the writer, seven decimal numbers.
inline constexpr const char* kPcdViewpoint = "pcd.viewpoint";

/// Reads the seven finite numbers of a viewpoint. @return nothing when there are fewer
[[nodiscard]] std::optional<std::array<double, 7>> read_pcd_viewpoint(Words words);

/// The greatest accepted size of a point, bytes.
inline constexpr std::size_t kMaxPcdPointBytes = std::size_t{1} << 20;

/// Reads the header, so that the stream is at the first byte of the points.
/// @throws DataError with the line that breaks a rule
[[nodiscard]] PcdHeader read_pcd_header(ByteStream& stream);

}  // namespace ptc
