// Mesh to surfels.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "engine/base/executor.h"
#include "engine/io/cloud/points.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc {

struct SamplingOptions {
  double spacing = 0;               ///< scene units between neighbours; 0: from count
  std::uint64_t count = 2'000'000;  ///< surfels wanted when spacing is 0, met within 2 % but
                                    ///< for those that are buried and left out
  std::optional<Camera> camera;     ///< finer where this camera looks close:
  float pixels_per_surfel = 1;      ///< at most so many pixels between neighbours in its view
  float finest = 0.125f;            ///< but never below this share of the spacing
  LightSampling lights;
};

/// Spacing that gives about `count` surfels on the mesh: sqrt(area / count), where both sides of
/// double-sided materials count. 0 for a mesh without area.
/// @throws RequestError when count is 0
[[nodiscard]] double spacing_for(const Mesh& mesh, std::uint64_t count);

/// Surfels spread evenly over a mesh, lit: radiance = emission + albedo / pi * irradiance.
///
/// Each surfel stands for a compact patch of surface of about spacing^2: the patches are Voronoi
/// cells whose middles are nearly regular, whatever the tessellation (see clusters.h). It lies on
/// the mesh at the patch's middle, across the patch's mean normal, moved inwards in its plane where
/// it would stick out over an edge (see surroundings.h); albedo, emission and light are the patch's
/// mean. Sum of 2 r^2 equals the mesh's area, less what is left out: patches all of which is buried
/// in solids. Double-sided materials give two surfels back to back. Deterministic for any thread
/// count. The order is that of the Z-curve, roughly. Memory: sampling_bytes().
/// @param light, scene, executor  must outlive the source
/// @throws RequestError when count, spacing or a camera's number makes no sense, or there
///         would be more than 9 * 10^10 surfels
[[nodiscard]] std::unique_ptr<PointSource> sample_mesh(const DirectLight& light,
                                                       const RayScene& scene,
                                                       const SamplingOptions& options,
                                                       const Executor& executor);
/// What sampling takes besides the mesh: 24 bytes a triangle or a thousandth of the surfels, and 20
/// MB a thread.
[[nodiscard]] std::uint64_t sampling_bytes(std::uint64_t triangles, std::uint64_t surfels,
                                           unsigned threads) noexcept;

}  // namespace ptc
