// Writes the points of a container, or of a cloud, in the formats that other programs read.
//
//   container ---- order of the curve, or of the input ----.
//                                                          +--> PointWriter --> .las .ply .xyz ...
//   cloud -------- read twice: bounds, then points --------'
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/selection.h"
#include "engine/store/reader.h"

namespace ptc {

/// How points are written to a file of another format.
struct PointFileOptions {
  /// Writes the points of a container in the order of its input, and leaves out the channel
  /// original_index, which they need for that.
  bool original_order = false;
  /// The channel that viewers shall show as colour; empty: the albedo
  /// (PointWriteInfo::colour_from).
  std::string colour_from;
  /// Measures for losses() what the format rounds. Without this, it is measured only where the
  /// writer of a cloud chooses its positions by it. All points of a container are read for it.
  bool measure_rounding = false;
  /// The text `las.vlrs` that is written in place of a container's own, which has room for 16 KiB;
  /// empty: the container's own.
  std::string las_records;
  Selection selection;  ///< which points are written, and which channels
  RunOptions run;       ///< memory, threads and temporary directories
};

/// Notes what becomes of values that stand for "not known" in a file of points that is about to be
/// written (unknown_losses()), and what is scaled by the values of its points (scaling_notes()).
/// Nothing for a target that is a container.
void note_changed_values(const std::filesystem::path& target, const PointWriteInfo& info,
                         Progress& progress);

/// Describes the points of a container for a writer. They are read when a selection must be
/// counted or the format has channels that are measured.
/// @param format  the format that will be written; nothing for a container
/// @throws RequestError as open_point_input(); FormatError, std::system_error
[[nodiscard]] PointWriteInfo describe_points(const ContainerReader& container,
                                             const PointFileOptions& options,
                                             std::optional<OutputFormat> format);
/// Describes the points of a cloud for a writer. The cloud is read to its end.
/// @param format  the format that will be written; nothing for a container
/// @throws DataError when it breaks its format; RequestError as open_point_input();
///         std::system_error
[[nodiscard]] PointWriteInfo describe_points(const std::filesystem::path& cloud,
                                             const PointFileOptions& options,
                                             std::optional<OutputFormat> format,
                                             Progress& progress);

/// Writes the points of a container with its channels. The ending of the target chooses the
/// format. The target is published when it is complete, and then read again and compared with what
/// was written (WrittenCheck).
/// @throws RequestError about `original_order` when the container does not know it, about `target`
///         when the format is unknown or cannot hold the points; LimitError; FormatError when the
///         container is damaged; std::system_error
/// Memory: at most RunOptions::memory_bytes.
ConvertReport container_to_points(const ContainerReader& container,
                                  const std::filesystem::path& target,
                                  const PointFileOptions& options, Progress& progress);

/// Writes the points of a cloud in another format, in their order. The cloud is read twice, and the
/// target once.
/// @throws DataError when the cloud breaks its format or changes between the passes, or when the
///         target is not what was written; RequestError as container_to_points(); std::system_error
/// Memory: below kBufferBytes.
ConvertReport cloud_to_points(const std::filesystem::path& cloud,
                              const std::filesystem::path& target, const PointFileOptions& options,
                              Progress& progress);

}  // namespace ptc
