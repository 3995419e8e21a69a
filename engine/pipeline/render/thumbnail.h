// Small pictures of containers, made in a moment: without shading, and of large scenes without
// their points.
#pragma once

#include <filesystem>

#include "engine/base/executor.h"
#include "engine/store/reader.h"

namespace ptc {

/// Width and height of a thumbnail, pixels.
inline constexpr unsigned kThumbnailWidth = 480, kThumbnailHeight = 270;

/// Draws a container and writes the picture as a PNG.
///
/// The camera is that of render_picture(). Surfels have the light that they were built with; where
/// they have none, they are lit from the camera in their own colour. Above two million points the
/// clusters of level 9 of the octree stand for them, of which only a small part of the file is
/// read.
/// @param target  is replaced as a whole or not at all
/// @throws FormatError when the container is damaged; std::system_error
/// Memory: 20 MiB at most, and the directory of the container.
void write_thumbnail(const ContainerReader& scene, const std::filesystem::path& target,
                     const Executor& executor);

}  // namespace ptc
