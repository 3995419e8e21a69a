// The rules that every surfel from a file must keep, and the choice of a reader.
#include "engine/io/cloud/points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/ply.h"
#include "engine/io/cloud/point_format.h"
#include "engine/io/cloud/point_layout.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/cloud/surfel_check.h"
#include "engine/io/text/byte_stream.h"

namespace ptc {
namespace {

bool all_finite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool all_within(const glm::dvec3& v, double most) {
  return v.x >= 0 && v.y >= 0 && v.z >= 0 && v.x <= most && v.y <= most && v.z <= most;
}

}  // namespace

std::string convert_surfel(const RawSurfel& raw, bool has_normals, Surfel& out) {
  constexpr double kMaxFloat = std::numeric_limits<float>::max();
  // Check the numbers against the ranges that records can hold.
  if (!all_finite(raw.position)) return "the position is not finite";
  if (!fits_coordinates(raw.position)) return "the position is beyond 2^999";
  if (!(raw.radius >= 0 && raw.radius <= kMaxFloat))
    return "the radius is negative, not a number or beyond the range of float";
  if (!all_within(raw.radiance, kMaxFloat))
    return "the radiance is negative, not a number or beyond the range of float";
  if (!all_within(raw.emission, kMaxFloat))
    return "the emission is negative, not a number or beyond the range of float";
  if (!all_within(raw.albedo, 1)) return "the colour is out of range";

  // Convert them.
  out.position = raw.position;
  out.normal = glm::vec3(0);
  out.radius = static_cast<float>(raw.radius);
  out.radiance = glm::vec3(raw.radiance);
  out.emission = glm::vec3(raw.emission);
  out.albedo = glm::vec3(raw.albedo);
  if (!has_normals) return {};

  // Normalise the normal; scale it first, because squares of very small or large components would
  // leave the range of double.
  if (!all_finite(raw.normal)) return "the normal is not finite";
  const double most =
      std::max({std::abs(raw.normal.x), std::abs(raw.normal.y), std::abs(raw.normal.z)});
  if (most == 0) return "the normal has zero length";
  const glm::dvec3 scaled = raw.normal / most;
  out.normal = glm::vec3(
      scaled / std::sqrt(scaled.x * scaled.x + scaled.y * scaled.y + scaled.z * scaled.z));
  return {};
}

namespace {

PointFile open_as(PointFormat format, const std::filesystem::path& path) {
  switch (format) {
    case PointFormat::ply:
      return open_ply(path);
    case PointFormat::las:
      return open_las(path);
    case PointFormat::pcd:
      return open_pcd(path);
    case PointFormat::e57:
      return open_e57(path);
    case PointFormat::ptc:
      return open_ptc(path);
    case PointFormat::bgeo:
      return open_bgeo(path);
    case PointFormat::pdb:
      return open_pdb(path);
    case PointFormat::ptx:
      return open_ptx(path);
    case PointFormat::pts:
      return open_pts(path);
    case PointFormat::xyz:
      break;
  }
  return open_xyz(path);
}

/// Returns the name of a format, for files that do not state a version of it.
const char* name_of(PointFormat format) {
  switch (format) {
    case PointFormat::ply:
      return "PLY";
    case PointFormat::las:
      return "LAS";
    case PointFormat::pcd:
      return "PCD";
    case PointFormat::e57:
      return "E57";
    case PointFormat::ptc:
      return "Pixar's point cloud";
    case PointFormat::bgeo:
      return "Houdini's classic geometry";
    case PointFormat::pdb:
      return "Maya's PDB";
    case PointFormat::ptx:
      return "PTX";
    case PointFormat::pts:
      return "PTS";
    case PointFormat::xyz:
      break;
  }
  return "XYZ text";
}

/// Says whether colours in fields of 16 bits are all up to 255, as many programs write them.
/// @param info  of the file
bool has_bytes_as_colours(PointFormat format, const std::filesystem::path& path,
                          const PointFileInfo& info) {
  const auto rgb = find_in_row(info.channels, "rgb");
  if (!rgb || rgb->channel->type != ChannelType::u16) return false;
  const PointFile probe = open_as(format, path);
  std::vector<Surfel> block(1 << 12);
  bool black = true;
  while (const std::size_t count = probe.source->next(block)) {
    const std::span<const std::byte> rows = probe.source->attributes();
    for (std::size_t at = rgb->offset; at < rows.size(); at += rows.size() / count) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (rows[at + 2 * k + 1] != std::byte{0}) return false;
        black = black && rows[at + 2 * k] == std::byte{0};
      }
    }
  }
  return !black;
}

bool is_text(PointFormat format) {
  return format == PointFormat::xyz || format == PointFormat::pts || format == PointFormat::ptx;
}

/// Refuses a file that is packed by gzip and is not read from front to back.
void refuse_packed(PointFormat format, const std::filesystem::path& path) {
  const bool in_order =
      format != PointFormat::las && format != PointFormat::e57 && format != PointFormat::pdb;
  if (in_order || !ByteStream(path).compressed()) return;
  refuse_file(path, std::string(name_of(format)) +
                        " packed by gzip, which cannot be read: unpack it first with gunzip, or "
                        "give what gunzip -c writes as standard input");
}

/// Notes that the name of a file states another format than its content has. Formats of text have
/// each other's endings too often to be worth a note.
void note_name(PointFormat format, const std::filesystem::path& path, PointFileInfo& info) {
  const std::optional<PointFormat> named = format_of_name(path);
  if (!named || *named == format || (is_text(*named) && is_text(format))) return;
  info.notes.push_back(std::string("The name says ") + name_of(*named) +
                       ", but the content is that of " + name_of(format) + ".");
}

}  // namespace

PointFile open_points(const std::filesystem::path& path) {
  const std::optional<PointFormat> format = point_format(path);
  if (!format) {
    refuse_file(path,
                "not a point cloud: its content and its name are those of none of PLY, LAS, LAZ, "
                "E57, PCD, PTX, PTS, XYZ text, Pixar's PTC, Houdini's classic BGEO and Maya's PDB");
  }
  refuse_packed(*format, path);
  PointFile file = open_as(*format, path);
  note_name(*format, path, file.info);
  if (file.info.format.empty()) file.info.format = name_of(*format);
  const bool may_be_bytes = *format == PointFormat::ply || *format == PointFormat::pcd;
  if (may_be_bytes && has_bytes_as_colours(*format, path, file.info)) {
    static_cast<RecordSource&>(*file.source).take_bytes_as_colours();
    std::ranges::find(file.info.channels, "rgb", &Channel::name)->scale = kByteScale;
    file.info.notes.emplace_back(
        "Colours are up to 255 in fields of 16 bits: taken as 8-bit ones.");
  }
  return file;
}

bool is_point_file(const std::filesystem::path& path) {
  if (names_text_cloud(path)) return true;
  const std::optional<PointFormat> format = point_format(path);
  if (format != PointFormat::ply) return format.has_value();
  const PlyReader reader(path);
  return std::ranges::none_of(reader.elements(), [](const PlyElement& element) {
    return (element.name == "face" || element.name == "tristrips") && element.count > 0;
  });
}

}  // namespace ptc
