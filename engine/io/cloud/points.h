// Reading of point clouds of many formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/stream.h"
#include "engine/base/surfel.h"
#include "format/schema.h"

namespace ptc {

/// The scale of a colour in fields of 16 bits that hold bytes: 255 is white.
inline constexpr double kByteScale = 1 / 255.0;

/// The facts about a point file that are known before its points are read.
struct PointFileInfo {
  std::string format;  ///< with its version where the file states one: "LAS 1.2, point format 3"
  /// The bounds that the header states, scene units, which may be wrong (PointSource::extent()).
  /// Nothing when it states none.
  std::optional<Bounds> stated_bounds;
  /// The number of records, those that PointSource::left_out() counts among them; nothing when the
  /// file does not say it before its end.
  std::optional<std::uint64_t> count;
  bool has_normals = false;   ///< otherwise normals are 0; a point without one has 0, too
  bool has_radius = false;    ///< otherwise radii are 0
  bool has_radiance = false;  ///< otherwise radiance is 0
  bool has_emission = false;  ///< otherwise emission is 0
  bool has_albedo = false;    ///< the file has colours; otherwise albedo is 0.5
  /// The format has a normal and a radius for every point; where all of them are 0, there are none.
  bool zeros_mean_none = false;
  /// What the file records of a point beyond its surfel, in the order of PointSource::attributes().
  /// The group of a channel means nothing here.
  std::vector<Channel> channels;
  /// Facts about the file as a whole under the keys of spec/points.md#texts, such as `up` and
  /// `crs`.
  std::map<std::string, std::string> text;
  /// Where the scanners stood, scene units. A channel named `scan` holds the index of the scanner
  /// of each point; without one, all points are of the first. Empty when that is not known.
  std::vector<glm::dvec3> scanners;
  /// What the reader leaves out or assumes, one sentence each, for the user.
  std::vector<std::string> notes;
};

/// An open point file.
struct PointFile {
  PointFileInfo info;
  std::unique_ptr<PointSource> source;  ///< yields the points once, in the order of the file
};

/// Opens a point cloud for one pass in constant memory.
///
/// | format | files | what is special |
/// |---|---|---|
/// | PLY | .ply | scalar properties of `vertex`; lists and other elements are left out |
/// | LAS, LAZ, COPC | .las .laz | |
/// | E57 | .e57 | |
/// | PCD | .pcd | 0.5 to 0.7; ascii, binary, binary_compressed; grids get `row` and `column` |
/// | PTX | .ptx | all scans of the file, placed by their matrices; `scan`, `row`, `column` |
/// | PTS | .pts | all blocks of the file |
/// | XYZ text | .xyz .xyzn .asc .txt .csv | columns by name, or by their number and values |
/// | Pixar's PTC | .ptc | the channel `_radiosity` or `Cs` is the radiance |
/// | Houdini's classic geometry | .bgeo .geo | points only |
/// | Maya's PDB | .pdb | files of programs of 32 bits |
///
/// The content decides, and the name only where the content says nothing; a note says when they
/// differ. PLY, BGEO, PTC and text, a PCD that is not compressed, and PTX may be packed by gzip
/// (.gz). `info.notes` says what a reader leaves out or assumes.
///
/// Properties with these names make the surfel: x y z; nx ny nz or normal_x normal_y normal_z;
/// radius or scalar_radius; radiance_r radiance_g radiance_b; emission_r emission_g emission_b; red
/// green blue or diffuse_red diffuse_green diffuse_blue or, as integers, r g b. The last are the
/// albedo: integers are sRGB (8 bits; 16 for short types) and are kept in the channel `rgb`, too;
/// floats are linear in [0, 1]. Integers rgb_r rgb_g rgb_b are the channel `rgb` as PTCX writes it
/// beside a colour of fewer bits, whose place they take. All other properties become channels of
/// their type. Extra bytes of
/// LAS are such properties; there NormalX NormalY NormalZ are a normal, too, and plain integers are
/// no part of the surfel.
///
/// Lines of XYZ without names are "x y z [nx ny nz [radius [r g b]]]", where r g b is the linear
/// radiance; "x y z intensity"; or "x y z" with 8-bit colours, if their values look like that.
/// Other columns become channels. Separators are white space, commas or semicolons, and comments
/// begin with # or //. All lines have as many values as the first. A column in which none of the
/// first lines has a number is left out; decimal commas are refused.
///
/// Every surfel is checked: the position is within kMaxCoordinate, the normal has a finite length
/// (it is normalised; 0 0 0 is unknown), radius, radiance and emission are finite and not negative,
/// and the albedo is in [0, 1]. A point whose position has a NaN is left out and counted. A file
/// that ends early, or counts more points than it can hold, is refused, and so is one that goes on
/// after its last point where its format says how many there are.
/// @throws DataError that names the file, the offset (binary) or line (text) and the point;
///         std::system_error
/// Memory: below 1 MiB, and more for compressed files and lines over 256 KiB (see ByteStream).
[[nodiscard]] PointFile open_points(const std::filesystem::path& path);

/// Says whether a file is a point cloud that open_points() reads: by its name if that is one of
/// text (.xyz .xyzn .asc .txt .csv .pts .ptx), without looking into it, else by its content. A PLY
/// with faces is a mesh.
/// @throws DataError when a PLY header breaks a rule; std::system_error
[[nodiscard]] bool is_point_file(const std::filesystem::path& path);

}  // namespace ptc
