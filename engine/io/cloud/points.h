// Point clouds in and out: PLY and XYZ.
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
#include "format/schema.h"

namespace ptc {

/// What a point file says of itself before its points are read.
struct PointFileInfo {
  std::optional<std::uint64_t> count;  ///< XYZ does not say
  bool has_normals = false;            ///< without, normals are 0: surfels that nothing can light
  bool has_radius = false;             ///< without, radii are 0
  bool has_radiance = false;           ///< without, surfels are black
  bool has_albedo = false;             ///< colour; without, albedo is 0.5
};

struct PointFile {
  PointFileInfo info;
  std::unique_ptr<PointSource> source;
};

/// Opens a cloud for one pass, in constant memory.
///
/// PLY, ascii or binary, may be gzipped (.ply.gz). Properties of `vertex`: x y z; nx ny nz or
/// normal_x normal_y normal_z; radius or scalar_radius; radiance_r radiance_g radiance_b; red green
/// blue or diffuse_red diffuse_green diffuse_blue, the albedo: integers are sRGB (8 bits; 16 for
/// short types), floats linear in [0, 1]. Others are passed over.
///
/// XYZ text (.xyz .xyzn .asc .txt): lines "x y z [nx ny nz [radius [r g b]]]", r g b the linear
/// radiance, # comments; all lines have as many values as the first.
///
/// Every surfel is checked: position finite and within kMaxCoordinate, normal of non-zero finite
/// length (it is normalised), radius finite and not negative, radiance finite and not negative,
/// albedo in [0, 1]. A PLY that ends early, counts more than it can hold, or goes on after its last
/// element is refused.
/// @throws DataError naming file, offset (binary) or line (text) and point; std::system_error
/// Memory: below 1 MiB, for packed files and lines over 256 KiB more (see ByteStream).
[[nodiscard]] PointFile open_points(const std::filesystem::path& path);

/// True when the name ends like a cloud (.xyz .xyzn .asc .txt) or, for .ply and .ply.gz, when the
/// file has no faces. @throws DataError, std::system_error as open_points()
[[nodiscard]] bool is_point_file(const std::filesystem::path& path);

/// A named per-point quantity for a sink, `components` floats a point.
struct PointColumn {
  std::string name;         ///< PLY property, of letters, digits and _
  unsigned components = 1;  ///< 1: the name as it is; 3: with _r _g _b; else with _0 _1 ...
  bool vector = false;      ///< three components get _x _y _z instead
};

/// Channels as columns of a PLY, with the names that spec/points.md#ply gives them: none is a
/// property of the surfel, and none is there twice.
[[nodiscard]] std::vector<PointColumn> ply_columns(std::span<const Channel> channels);

/// Writes binary little-endian PLY: x y z (double), nx ny nz, radius, radiance_rgb, albedo as
/// red green blue (float), then the columns (float). Published when finish() returns.
class PlyWriter {
 public:
  /// @param count  exact number of points that will come
  /// @throws std::system_error; std::invalid_argument when a column's name is no property name or
  ///         is taken
  PlyWriter(const std::filesystem::path& target, std::uint64_t count,
            std::vector<PointColumn> columns);
  ~PlyWriter();
  /// @param values  surfels.size() x sum of components, point by point
  /// @throws std::invalid_argument when `values` has another size; std::system_error
  void write(std::span<const Surfel> surfels, std::span<const float> values);
  /// @throws std::invalid_argument when fewer or more points came than announced
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
