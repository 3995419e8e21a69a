// Internal to the point readers: one function for each format, and what they share.
//
//   open_points() --point_format()--> open_ply(), open_las() ... --> PointFile
//
// A reader yields surfels and, beside them, rows of attributes:
//
//   Surfel   position normal radius albedo ...      what the light of a point needs
//   row      intensity | classification | time ...  everything else, as the file has it
#pragma once

#include <bit>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/io/cloud/points.h"

namespace ptc {

static_assert(std::endian::native == std::endian::little, "rows and channels are little-endian");

/// Each opens a file of its format as open_points() describes.
[[nodiscard]] PointFile open_bgeo(const std::filesystem::path& path);
[[nodiscard]] PointFile open_e57(const std::filesystem::path& path);
[[nodiscard]] PointFile open_las(const std::filesystem::path& path);  ///< LAS, LAZ and COPC
[[nodiscard]] PointFile open_pcd(const std::filesystem::path& path);
[[nodiscard]] PointFile open_pdb(const std::filesystem::path& path);
[[nodiscard]] PointFile open_ply(const std::filesystem::path& path);
[[nodiscard]] PointFile open_ptc(const std::filesystem::path& path);
[[nodiscard]] PointFile open_pts(const std::filesystem::path& path);
[[nodiscard]] PointFile open_ptx(const std::filesystem::path& path);
[[nodiscard]] PointFile open_xyz(const std::filesystem::path& path);

/// Opens a file by a source of points whose info() describes it.
template <class Source, class... Arguments>
[[nodiscard]] PointFile open_source(Arguments&&... arguments) {
  auto source = std::make_unique<Source>(std::forward<Arguments>(arguments)...);
  PointFileInfo info = source->info();
  return {std::move(info), std::move(source)};
}

/// Appends a value to rows of attributes.
template <typename T>
void append_value(std::vector<std::byte>& rows, T value) {
  static_assert(std::is_arithmetic_v<T>);
  const auto at = rows.size();
  rows.resize(at + sizeof value);
  std::memcpy(rows.data() + at, &value, sizeof value);
}

/// Makes a name that a channel may have of any text: letters become lower case, runs of other
/// characters than [a-z0-9_.] become one `_`, and what is over 31 bytes is cut. A name that one of
/// `others` has gets a number at its end.
[[nodiscard]] std::string channel_name(std::string_view text, std::span<const Channel> others);

}  // namespace ptc
