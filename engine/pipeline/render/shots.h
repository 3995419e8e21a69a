// The frames of a sequence: their numbers, their cameras and the names of their files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/render/picture_files.h"
#include "engine/scene/camera.h"

namespace ptc {

/// Numbers of frames: first, first + step, and so on, up to last.
struct FrameRange {
  std::int64_t first = 1, last = 1;
  std::int64_t step = 1;

  /// Returns how many frames there are. @pre first <= last, step > 0
  [[nodiscard]] std::size_t count() const noexcept {
    return static_cast<std::size_t>((last - first) / step) + 1;
  }
  /// Returns the number of a frame by its index.
  [[nodiscard]] std::int64_t operator[](std::size_t index) const noexcept {
    return first + static_cast<std::int64_t>(index) * step;
  }
};

/// A sequence of pictures.
struct SequenceRequest {
  FrameRange frames;
  double frames_per_second = 24;  ///< frame f shows animations of glTF at f / frames_per_second
  /// Frames in which the camera goes once around its target, or around the middle of what is seen
  /// if it is that of a file: to the right at first, about the axis that points up; frame 1 is the
  /// view without it. 0: it does not.
  unsigned turntable = 0;
};

/// Returns the moment of a frame. @param index  of the frame
[[nodiscard]] Moment moment_of(const SequenceRequest& sequence, std::size_t index);

/// @throws RequestError when a number is out of range or there are too many frames
void check_sequence(const SequenceRequest& sequence);

/// Returns a camera that has gone around a place.
/// @param up     axis, unit
/// @param angle  radians, counter-clockwise seen from above
[[nodiscard]] Camera turned_around(Camera camera, const glm::dvec3& middle, const glm::dvec3& up,
                                   double angle);

/// Returns the angle by which a turntable has turned the camera at a frame, radians.
[[nodiscard]] double turntable_angle(const SequenceRequest& sequence, std::int64_t frame);

/// Returns a name in which the number of a frame takes the place of its mark: the last run of # in
/// the name of the file, or %d, or %0Nd; the number gets zeros in front, up to the length of the
/// mark. Nothing without a mark.
[[nodiscard]] std::optional<std::filesystem::path> frame_name(const std::filesystem::path& path,
                                                              std::int64_t frame);

/// Returns the targets of a frame.
/// @throws RequestError when the name of one has no mark
[[nodiscard]] std::vector<PictureTarget> targets_of_frame(std::span<const PictureTarget> targets,
                                                          std::int64_t frame);

}  // namespace ptc
