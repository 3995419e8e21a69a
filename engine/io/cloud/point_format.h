// Internal to the point readers: which format a file has.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace ptc {

/// The formats of point clouds that can be read. `las` stands for LAS, LAZ and COPC, `bgeo` also
/// for .geo, its text.
enum class PointFormat : std::uint8_t { ply, las, pcd, e57, ptc, bgeo, pdb, ptx, pts, xyz };

/// Finds the format of a file, which may be compressed by gzip: by the bytes with which it begins,
/// else by the ending of its name if that is one of text (.pts only if its first lines do not look
/// like XYZ), else by the shape of its first lines, else by the ending. A PLY may be a mesh.
/// @return nothing when it is no point cloud; for names of meshes (.obj .off .stl .gltf .glb)
///         without looking into the file
/// @throws std::system_error; DataError when the name ends in .gz and the file is not whole
[[nodiscard]] std::optional<PointFormat> point_format(const std::filesystem::path& path);

/// Finds the format that the ending of a name states, before .gz if it ends so. Nothing when it
/// states none.
[[nodiscard]] std::optional<PointFormat> format_of_name(const std::filesystem::path& path);

/// Returns what may help the user of a file that nothing can read, to be added to the message: that
/// it is packed, or that it looks like columns of numbers. Empty when there is no such hint.
/// @throws std::system_error
[[nodiscard]] std::string hint_at_content(const std::filesystem::path& path);

/// Says whether the name of a file is one of clouds in text: it ends in .xyz .xyzn .asc .txt .csv
/// .pts or .ptx, with or without .gz. The file need not exist.
[[nodiscard]] bool names_text_cloud(const std::filesystem::path& path);

}  // namespace ptc
