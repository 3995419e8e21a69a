// Samples a mesh into lit surfels.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "engine/base/executor.h"
#include "engine/io/cloud/points.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// How finely a mesh is sampled, and how its surfels are lit.
struct SamplingOptions {
  /// Distance between neighbouring surfels, scene units. 0 takes spacing_for() the count.
  double spacing = 0;
  /// Surfels wanted when `spacing` is 0. The result is within 2 % of it, less the surfels that are
  /// buried and left out; of double-sided materials these are made up for, within some 5 %.
  std::uint64_t count = 2'000'000;
  /// Makes the spacing finer where the surface turns or its light changes, and wider elsewhere; the
  /// number of surfels stays about that of an even spacing (adapted_spacing.h). Of meshes in memory
  /// alone.
  bool adapts = false;
  /// A camera in whose view the spacing is finer where it looks close.
  std::optional<Camera> camera;
  float pixels_per_surfel = 1;  ///< maximum distance between neighbours in that view, pixels
  float finest = 0.125f;        ///< minimum spacing in that view, as a share of `spacing`
  LightSampling lights;         ///< shadow rays for each surfel
  /// Keeps the sides of double-sided materials that no light reaches, because light comes later.
  bool keeps_dark = false;
};

/// Checks everything about the options that does not depend on the mesh.
/// @throws RequestError when count, spacing or a number of the camera makes no sense
void check_sampling(const SamplingOptions& options);

/// Checks the options, and completes them with the spacing that their count asks for.
/// @param area  of the mesh, scene units squared, where both sides of double-sided materials count
/// @throws RequestError when an option makes no sense, or there would be more than 9 * 10^10
///         surfels
[[nodiscard]] SamplingOptions with_spacing(SamplingOptions options, double area);
/// Returns the area of a mesh, where both sides of double-sided materials count.
/// @param first  the first triangle that counts
[[nodiscard]] double sampled_area(const Mesh& mesh, std::uint32_t first = 0);

/// Returns the spacing that gives about `count` surfels on the mesh: sqrt(area / count), where both
/// sides of double-sided materials count. It is 0 for a mesh without area.
/// @throws RequestError when count is 0
[[nodiscard]] double spacing_for(const Mesh& mesh, std::uint64_t count);

/// The least share of a mesh's area that its spacing is found by. Less would make surfels finer
/// than anyone asks for, without end where nothing of the mesh is seen.
inline constexpr double kLeastSeen = 0.05;

/// Returns the area of a mesh of which surfels come: sampled_area() less what is estimated to be
/// buried of double-sided materials, or to let light through, from 4,096 places. It is at least
/// kLeastSeen of sampled_area().
/// @param rays  shadow rays of each surfel
[[nodiscard]] double seen_area(const DirectLight& light, const RayScene& scene,
                               const LightSampling& rays, const Executor& executor);

/// Makes a stream of surfels that are spread evenly over a mesh and lit: radiance =
/// albedo / pi * irradiance of the lamps and emitters; what a surfel emits is kept apart.
///
/// Each surfel stands for a compact patch of surface of about spacing^2. The patches are Voronoi
/// cells whose middles are nearly regular, whatever the tessellation (see clusters.h). A surfel
/// lies on the mesh at the patch's middle, across the patch's mean normal, moved inwards in its
/// plane where it would stick out over an edge (see surroundings.h). Its albedo, emission and light
/// are the means of the patch. A patch that is wholly buried in solids is left out. The sum of
/// 2 r^2 over all surfels equals the area of the mesh less the area of those patches. Double-sided
/// materials give two surfels back to back.
///
/// The result is deterministic for any thread count. Its order is roughly that of the Z-curve.
/// Memory: sampling_bytes().
/// @param light, scene, executor  must outlive the source
/// @param at_once  patches that are made at the same time, at most; 0: one for each thread
/// @param first    the first triangle of the mesh that gets surfels; those before it are only in
///                 the way
/// @throws RequestError when count, spacing or a camera's number makes no sense, or there
///         would be more than 9 * 10^10 surfels
[[nodiscard]] std::unique_ptr<PointSource> sample_mesh(
    const DirectLight& light, const RayScene& scene, const SamplingOptions& options,
    const Executor& executor, unsigned at_once = 0, std::uint32_t first = 0);
/// The bytes that a patch takes while its surfels are made.
inline constexpr std::uint64_t kSampledPatchBytes = std::uint64_t{20} << 20;
/// Returns the bytes that sampling takes in addition to the mesh: 24 for each triangle or for each
/// thousand surfels, whichever are more, and kSampledPatchBytes for each patch; where the spacing
/// adapts, kAdaptingBytes for each surfel, too.
/// @param adapts   as in SamplingOptions
/// @param at_once  as for sample_mesh(), above 0
[[nodiscard]] std::uint64_t sampling_bytes(std::uint64_t triangles, std::uint64_t surfels,
                                           bool adapts, unsigned at_once) noexcept;

}  // namespace ptc
