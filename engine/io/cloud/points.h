// Reading and writing of point clouds: PLY and XYZ files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/stream.h"
#include "engine/base/surfel.h"
#include "engine/io/file/buffered_output.h"
#include "format/schema.h"

namespace ptc {

/// The facts about a point file that are known before its points are read.
struct PointFileInfo {
  std::optional<std::uint64_t> count;  ///< number of points; XYZ files do not record it
  bool has_normals = false;            ///< otherwise normals are 0, and nothing can light a surfel
  bool has_radius = false;             ///< otherwise radii are 0
  bool has_radiance = false;           ///< otherwise radiance is 0
  bool has_emission = false;           ///< otherwise emission is 0
  bool has_albedo = false;             ///< the file has colours; otherwise albedo is 0.5
};

/// An open point file.
struct PointFile {
  PointFileInfo info;
  std::unique_ptr<PointSource> source;  ///< yields the points once, in the order of the file
};

/// Opens a point cloud for one pass in constant memory.
///
/// PLY files, ascii or binary, may be compressed (.ply.gz). These properties of `vertex` are read:
/// x y z; nx ny nz or normal_x normal_y normal_z; radius or scalar_radius; radiance_r radiance_g
/// radiance_b; emission_r emission_g emission_b; red green blue or diffuse_red diffuse_green
/// diffuse_blue. The last six are the albedo: integers are sRGB (8 bits; 16 for short types),
/// floats are linear in [0, 1]. All other properties are skipped.
///
/// XYZ text files (.xyz .xyzn .asc .txt) have lines "x y z [nx ny nz [radius [r g b]]]", where r g
/// b is the linear radiance, and comments that begin with #. All lines have as many values as the
/// first.
///
/// Every surfel is checked: the position is finite and within kMaxCoordinate, the normal has a
/// non-zero finite length (it is normalised), radius, radiance and emission are finite and not
/// negative, and
/// the albedo is in [0, 1]. A PLY file that ends early, counts more records than it can hold, or
/// goes on after its last element is refused.
/// @throws DataError that names the file, the offset (binary) or line (text) and the point;
///         std::system_error
/// Memory: below 1 MiB, and more for compressed files and lines over 256 KiB (see ByteStream).
[[nodiscard]] PointFile open_points(const std::filesystem::path& path);

/// Says whether a file is a point cloud: its name ends in .xyz, .xyzn, .asc or .txt, or in .ply or
/// .ply.gz and the file has no faces.
/// @throws DataError when a PLY header breaks a rule; std::system_error
[[nodiscard]] bool is_point_file(const std::filesystem::path& path);

/// A named quantity of every point that PlyWriter writes in addition to the surfel.
struct PointColumn {
  std::string name;         ///< name of the PLY property, of letters, digits and _
  unsigned components = 1;  ///< 1 keeps the name; 3 appends _r _g _b; others append _0 _1 ...
  bool vector = false;      ///< three components append _x _y _z instead of _r _g _b
};

/// Returns the columns under which a PLY file holds channels. Their names are those of
/// spec/points.md#ply; none is a property of the surfel, and no two are equal.
[[nodiscard]] std::vector<PointColumn> ply_columns(std::span<const Channel> channels);

/// Writes a binary little-endian PLY file: x y z (double), nx ny nz, radius, radiance_rgb, albedo
/// as red green blue, emission_rgb where points may emit light (float), then the columns (float).
/// The file replaces its target when finish() returns.
class PlyWriter {
 public:
  /// Begins a file.
  /// @param count  exact number of points that will follow
  /// @param emits  whether emission is written
  /// @throws std::system_error; std::invalid_argument when the name of a column cannot name a
  ///         property or occurs twice
  PlyWriter(const std::filesystem::path& target, std::uint64_t count, bool emits,
            std::vector<PointColumn> columns);
  /// Writes the next points.
  /// @param values  values of the columns, surfels.size() x sum of components, point by point
  /// @throws std::invalid_argument when `values` has another size; std::system_error
  void write(std::span<const Surfel> surfels, std::span<const float> values);
  /// Ends the file and puts it in the place of its target.
  /// @throws std::invalid_argument when the number of points is not the announced one;
  ///         std::system_error
  void finish();

 private:
  std::vector<PointColumn> columns_;
  std::string header_;       ///< made before the file, so that a bad column leaves no file
  bool emits_;               ///< emission is written
  std::uint64_t announced_;  ///< points of the header
  std::uint64_t written_ = 0;
  std::size_t values_per_point_ = 0;
  BufferedOutput out_;
};

}  // namespace ptc
