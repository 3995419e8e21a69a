// The depth buffer of a picture of surfels, and the closing of pinholes in it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "engine/base/executor.h"
#include "engine/shade/scene_scale.h"

namespace ptc {

/// The part of a surfel that a sample of a picture keeps.
struct SplatPayload {
  std::uint32_t radiance = 0;  ///< rgbe
  std::array<std::int16_t, 2> normal{};
  std::uint16_t radius = 0;  ///< ufloat16, scene units
  std::array<std::uint8_t, 3> albedo{};
  bool back = false;      ///< the camera sees the side away from the normal
  std::uint8_t rise = 0;  ///< radii by which a receiver must rise, in eighths (kRiseChannel)
};

/// What a sample of a picture sees.
struct SplatSample {
  /// t of the place t (x, y, 1) in the axes of the camera, edges of the frame; infinite where there
  /// is nothing.
  float depth = std::numeric_limits<float>::infinity();
  SplatPayload payload;

  [[nodiscard]] bool empty() const noexcept {
    return depth == std::numeric_limits<float>::infinity();
  }
};

/// The samples of a picture, row by row from the top.
struct SplatPicture {
  std::span<SplatSample> samples;
  unsigned width = 0, height = 0;  ///< samples
  float focal = 1;                 ///< distance of the image plane, in samples
  SceneScale scale;
  /// Greatest radius, edges of the frame, by which a disc closes holes: a wider one closes none
  /// that is wider.
  float widest = std::numeric_limits<float>::infinity();
};

/// The distance within which samples decide about a hole, rows or columns of samples.
inline constexpr unsigned kHoleReach = 192;

/// Closes holes between discs, through which the background or a farther surface shows.
///
/// A sample is in a hole of a surface when it is surrounded by that surface within four radii of
/// its discs: along at least seven of eight directions of the picture there is a sample in front of
/// it, no farther away than four times the radius of its disc as the picture shows it, or four
/// times `widest` where that is less. Five directions are enough where it sees the back of a disc,
/// as past the rim of a closed surface, or three within one and a half radii. The sample then sees
/// what the nearest of them does, at their mean nearness. So gaps that are as wide as the distance
/// between points are closed, and wider ones, which the scan resolves, stay: points that lie at
/// random leave a fraction of a percent of a surface farther than two radii from the next. What
/// becomes of a sample depends on those that are at most kHoleReach rows and columns away.
/// @return the number of samples that were closed
std::size_t close_holes(const SplatPicture& picture, const Executor& executor);

}  // namespace ptc
