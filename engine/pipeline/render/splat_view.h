// A view of surfels as a depth buffer of discs: what sees the surfels of a container by rays
// (cloud_view.cpp) and what draws surfels of any source (splat_view.cpp) have in common.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/surfel.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/splat_holes.h"
#include "engine/scene/camera.h"
#include "engine/shade/scene_scale.h"
#include "engine/store/reader.h"

namespace ptc {

/// A view by a depth buffer, which derived classes fill.
///
/// A surfel is a disc with centre c, unit normal n and radius r in the axes of the camera. The ray
/// of a sample is k = (x, y, 1), and it meets the plane of the disc at t k:
///
///    eye *----------------------- z
///          `  .         / disc
///               `  .   /
///                    `*  t = (c . n) / (k . n), a hit when |t k - c| < r
///                    /   `  .
///                              k
class SplatView : public PrimaryView {
 public:
  /// Makes a view without a depth buffer. @param lift  as for view_surfels()
  SplatView(const ContainerReader& scene, const Camera& camera, unsigned side, float lift);

  [[nodiscard]] std::optional<PrimaryHit> at(unsigned x, unsigned y) const override;

 protected:
  /// Empties the depth buffer for another part of the picture.
  void begin(const SampleRect& area);
  /// Closes the holes between the discs. To be called when the depth buffer is full.
  void finish(const Executor& executor);
  /// Returns the rectangle of the whole picture.
  [[nodiscard]] SampleRect whole() const noexcept { return {0, 0, width_, height_}; }
  /// Returns the place of a sample in the depth buffer.
  [[nodiscard]] std::size_t place_of(unsigned x, unsigned y) const noexcept {
    return std::size_t{y - area_.y0} * (area_.x1 - area_.x0) + (x - area_.x0);
  }
  /// Returns the ray of a sample in the camera's axes, with z = 1.
  [[nodiscard]] glm::vec3 ray(unsigned x, unsigned y) const {
    return {(static_cast<float>(x) + 0.5F - 0.5F * static_cast<float>(width_)) / focal_,
            (static_cast<float>(y) + 0.5F - 0.5F * static_cast<float>(height_)) / focal_, 1};
  }
  /// Returns what a sample keeps of a surfel, but for its `back`.
  /// @param rise  radii by which a receiver on it must rise
  [[nodiscard]] static SplatPayload payload_of(const Surfel& surfel, float rise);

  glm::dvec3 position_;  ///< of the eye, scene units
  Frame frame_;
  SceneScale scale_;
  glm::mat3 axes_{1};        ///< columns: right, down, forward
  unsigned width_, height_;  ///< of the whole picture, samples
  SampleRect area_;          ///< that the depth buffer covers
  float lift_;
  bool sky_included_;                                      ///< in the radiance of the surfels
  float focal_ = 1;                                        ///< in samples
  float widest_ = std::numeric_limits<float>::infinity();  ///< as in SplatPicture
  std::vector<SplatSample> samples_;
};

}  // namespace ptc
