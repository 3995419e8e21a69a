// Chooses points and channels of the files that are built or converted.
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

/// The name of the channel that Selection::classes are values of.
inline constexpr const char* kClassChannel = "classification";

/// Which points are taken, and what of them. The conditions hold together; `every` counts the
/// points that the others take.
struct Selection {
  std::optional<Bounds> box;           ///< scene units; points within, those on its faces included
  std::vector<std::uint64_t> classes;  ///< values of the channel kClassChannel; empty: all
  std::uint64_t every = 1;             ///< takes the first of every so many points, 1 or more
  /// Names of the channels that are kept; without a value, all are.
  std::optional<std::vector<std::string>> channels;
  /// A level of the octree of a container, whose clusters are taken in place of its points: one for
  /// each of its cells, and for each leaf above it. They have a normal, a radius and the light that
  /// leaves them, but no channels and no colour.
  std::optional<unsigned> level;

  /// Says whether every point is taken.
  [[nodiscard]] bool takes_all() const noexcept {
    return !box && classes.empty() && every == 1 && !level;
  }
};

/// Returns the channels that a selection keeps, in their order.
/// @param path      of the file that has the channels, for the error
/// @throws RequestError when it names a channel that is not there
[[nodiscard]] std::vector<Channel> kept_channels(std::span<const Channel> channels,
                                                 const Selection& selection,
                                                 const std::filesystem::path& path);

/// Yields the points of a source that a selection takes, with rows of the channels that it keeps.
/// Its level counts for nothing here.
/// @param channels  of the source
/// @param path      of the file, for the error
/// @throws RequestError when the selection needs a channel that is not there
[[nodiscard]] std::unique_ptr<PointSource> select_points(std::unique_ptr<PointSource> source,
                                                         std::span<const Channel> channels,
                                                         const Selection& selection,
                                                         const std::filesystem::path& path);

}  // namespace ptc
