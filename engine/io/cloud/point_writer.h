// Writing of point clouds in the formats that other programs read.
//
//   create_points() --> PointWriter --write(), write() ...--> --finish()--> the target is replaced
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "engine/base/surfel.h"
#include "format/schema.h"

namespace ptc {

/// A format in which points can be written.
enum class OutputFormat : std::uint8_t {
  bgeo,  ///< Houdini's classic binary geometry, version 5
  las,   ///< LAS 1.4, point format 6, 7 or 8
  pcd,   ///< Point Cloud Library, version 0.7, binary
  ply,   ///< binary little-endian PLY
  ptc,   ///< RenderMan point cloud
  usda,  ///< USD as text: one prim of type Points
  usdc,  ///< USD as a crate file: one prim of type Points
  xyz    ///< text with one point on each line
};

/// The values that a channel of one component has in some points, after its scale and offset.
struct ValueRange {
  double low = std::numeric_limits<double>::infinity();    ///< of the finite values
  double high = -std::numeric_limits<double>::infinity();  ///< below `low` when there are none
  bool whole = true;                                       ///< all of them are integers
};

/// A grid in which points lie row by row, each cell with one of them.
struct PointGrid {
  std::uint64_t width = 0;   ///< columns
  std::uint64_t height = 0;  ///< rows, at least 2
};

/// The most digits behind the point that are counted.
inline constexpr unsigned kMostDecimals = 15;

/// What a format really rounds of points, measured over all of them (RoundingSurvey). What a format
/// cannot round stays as it is here.
struct Rounding {
  double float_error = 0;  ///< the most by which a coordinate moves when it is rounded to float
  int last_bit = 1024;     ///< all coordinates are multiples of 2^last_bit
  /// All coordinates are decimals with so many digits behind the point, but for the last bits of a
  /// double; beyond kMostDecimals when some are not.
  unsigned decimals = 0;
  /// How far coordinates are from the steps of the LAS file that they came from, in steps.
  double step_error = 0;
  bool normals = false;            ///< 16 bits for each of two angles change a normal
  bool albedos = false;            ///< 16 bits on the sRGB curve change an albedo
  bool recoloured = false;         ///< a point has an albedo that is not its stored colour
  std::set<std::string> channels;  ///< those with a value that their type in the file does not hold
};

/// What a point file will hold.
struct PointWriteInfo {
  std::uint64_t count = 0;                  ///< exact number of points
  std::vector<Channel> channels;            ///< columns of the rows of write(), in their order
  std::map<std::string, std::string> text;  ///< facts under the keys of spec/points.md#texts
  Bounds bounds;                            ///< holds all points, scene units
  /// The ranges of measured_channels(), by their names; a channel that is missing was not measured.
  std::map<std::string, ValueRange> ranges;
  /// The grid of the channels `row` and `column`, if they are measured_channels() and the points
  /// are written in its order; nothing otherwise.
  std::optional<PointGrid> grid;
  /// What the format rounds; nothing when that was not measured, and then losses() says what it may
  /// round.
  std::optional<Rounding> rounding;
  bool has_normals = false;   ///< the normals of the surfels are worth writing
  bool has_radius = false;    ///< the radii are
  bool has_radiance = false;  ///< the radiances are
  bool has_albedo = false;    ///< the albedos are
  bool emits = false;         ///< the emissions are
  /// The channel that viewers shall show as the colour of a point, in place of its albedo; empty to
  /// show the albedo. The channel `occlusion` becomes a grey, white where nothing covers the point;
  /// another channel of one component is a grey itself; three components are linear light, which is
  /// compressed to the range of a screen. The formats bgeo, las, pcd, ply, usda and usdc have such
  /// a colour.
  std::string colour_from;
};

/// Writes the points of one file, in the order in which they come.
///
/// The target is replaced by finish(). A writer that is destroyed before leaves the target as it
/// was.
class PointWriter {
 public:
  virtual ~PointWriter() = default;
  /// Writes the next points.
  /// @param rows  the values of all channels of each point, little-endian and without padding, as
  ///              PointSource::attributes() has them
  /// @throws std::invalid_argument when `rows` has another size, or when a point lies outside of
  ///         the bounds of a LAS file; std::system_error
  virtual void write(std::span<const Surfel> surfels, std::span<const std::byte> rows) = 0;
  /// Ends the file and puts it in the place of its target.
  /// @throws std::invalid_argument when the number of points is not the announced one;
  ///         std::system_error
  virtual void finish() = 0;
};

/// Begins a file of points.
///
/// Nothing that a surfel or a channel holds is left out without a sentence in losses().
/// @throws RequestError about `target` when the format cannot hold so many points or channels, or
///         about `colour_from` when no channel has this name or the format shows no colours;
///         std::system_error
/// Memory: below 4 MiB, and 64 KiB for each channel of a USD file.
[[nodiscard]] std::unique_ptr<PointWriter> create_points(const std::filesystem::path& target,
                                                         OutputFormat format,
                                                         const PointWriteInfo& info);

/// Checks PointWriteInfo::colour_from, as create_points() does.
/// @throws RequestError about `colour_from`
void check_colour_from(OutputFormat format, const PointWriteInfo& info);

/// Returns the names of channels whose values decide how a format holds them. They are measured
/// before the file begins.
[[nodiscard]] std::vector<std::string> measured_channels(OutputFormat format,
                                                         std::span<const Channel> channels);

/// Returns what a file of this format would not keep, and what it would round and by how much, a
/// sentence each. Of what was measured (PointWriteInfo::rounding), it says only what is rounded.
[[nodiscard]] std::vector<std::string> losses(OutputFormat format, const PointWriteInfo& info);

/// What losses() says of a coordinate reference system that a format cannot name.
inline constexpr const char* kLostCrs = "The file does not name its coordinate reference system.";

/// Returns what becomes of values that stand for "not known" where a file of this format cannot say
/// so, a sentence each. They are among those of losses().
[[nodiscard]] std::vector<std::string> unknown_losses(OutputFormat format,
                                                      const PointWriteInfo& info);

/// Returns which channels a file of this format scales by the values of these points, so that those
/// of another file may be scaled otherwise, a note each.
[[nodiscard]] std::vector<std::string> scaling_notes(OutputFormat format,
                                                     const PointWriteInfo& info);

/// Returns the format that the ending of a name stands for; nothing for an ending that names no
/// format of points.
/// @throws RequestError about `target` for .laz, which is only read
[[nodiscard]] std::optional<OutputFormat> output_format(const std::filesystem::path& path);

}  // namespace ptc
