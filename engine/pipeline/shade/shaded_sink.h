// The files that shaded points are written to: a cloud, or a copy of a container with new channels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/surfel.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/pipeline/quality/check.h"
#include "engine/pipeline/shade/shading_channels.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// The maximum length of the text by which a shaded container records its settings.
inline constexpr std::size_t kMaxSettingsBytes = 240;

/// A file to which shaded points are written in their order. It is published by finish(); without
/// that, nothing is left under its name.
class ShadedSink {
 public:
  virtual ~ShadedSink() = default;
  /// Appends a block of points.
  /// @param rows       of the receivers' own channels, one row for each surfel; used by files of
  ///                   points
  /// @param lit        one result for each surfel, with what the sink was made for
  /// @param groups     radiance of each surfel in each group of lights, surfel after surfel; empty
  ///                   when the sink was made without groups
  /// @throws std::system_error
  virtual void write(std::span<const Surfel> surfels, std::span<const std::byte> rows,
                     const LitReceivers& lit, std::span<const glm::vec3> groups) = 0;
  /// Completes and publishes the file. @throws std::system_error
  virtual void finish() = 0;
};

/// Describes shaded points for make_shaded_sink(): those of the receivers, their channels without
/// those of an earlier shading, and the settings of the shading as a text.
/// @param points       number of points that will be written
/// @param settings     at most kMaxSettingsBytes
/// @param colour_from  as PointWriteInfo::colour_from
/// @param format       the format that will be written; nothing for a container
[[nodiscard]] PointWriteInfo shaded_points(const ContainerReader& receivers, std::uint64_t points,
                                           const std::string& settings,
                                           const std::string& colour_from,
                                           std::optional<OutputFormat> format);

/// Checks that the points of a container can be shaded into a target: a copy of the container has
/// room for the names and the record of the shading. It is called before work begins.
/// @param extras  what comes with the light of the points
/// @throws DataError when a channel of the receivers has the name of one that shading adds, or the
///         record does not fit a page of the receivers
void check_shaded_sink(const std::filesystem::path& target, const ContainerReader& receivers,
                       const ShadedExtras& extras);

/// Makes a sink for a file of points or a .ptcx, by the ending of the target.
/// @param receivers  container of the points that are shaded; a .ptcx copies its pages, so it must
///                   outlive the sink
/// @param info       from shaded_points()
/// @param extras     what comes with the light of the points
/// @pre check_shaded_sink()
/// @throws RequestError when the format cannot hold the points; std::system_error
[[nodiscard]] std::unique_ptr<ShadedSink> make_shaded_sink(const std::filesystem::path& target,
                                                           const ContainerReader& receivers,
                                                           const PointWriteInfo& info,
                                                           const ShadedExtras& extras);

/// Returns the bytes of memory that a sink needs for the pages and the directory of a .ptcx; 0 for
/// a file of points.
/// @param later  number of later_channels()
[[nodiscard]] std::uint64_t sink_bytes(const std::filesystem::path& target,
                                       const ContainerReader& receivers,
                                       std::size_t later = 0) noexcept;

}  // namespace ptc
