// Samples meshes that stand in many places: once for each shape and size.
#pragma once

#include <memory>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "engine/scene/sampling/mesh_parts.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/scene/sampling/streamed_sampler.h"
#include "engine/scene/sampling/surface_survey.h"

namespace ptc {

/// How surfels move to the place of what they are on.
class SurfelMove {
 public:
  /// @pre is_placement(place)
  explicit SurfelMove(const Placement& place);

  /// Returns a surfel in the place. Its disc is as large as the surface becomes there; a surfel
  /// without a normal grows with the size of the place.
  [[nodiscard]] Surfel of(const Surfel& surfel) const;

 private:
  glm::dmat3 linear_;
  glm::dvec3 shift_;
  glm::dmat3 normals_;  ///< the lengths that it gives are areas
  double size_;
};

/// Makes a stream of the surfels of MeshParts::placed(), as sample_parts() makes them.
///
///     places of a shape -> by the spacing that they want on the mesh, in steps of 2^(1/4)
///     mesh, spacing     -> sample_parts() -> some surfels -> set into every place -> the next ones
///
/// A place that wants less than one surfel gets one. The sizes of discs follow the area of the
/// surface, so that they cover it whatever the place does to it.
/// @param parts, found, executor  must outlive the source
/// @param options, room           as for sample_parts()
/// @throws as sample_parts()
[[nodiscard]] std::unique_ptr<PointSource> sample_placed(const MeshParts& parts,
                                                         const SurfaceSurvey& found,
                                                         const SamplingOptions& options,
                                                         const StreamingRoom& room,
                                                         const Executor& executor);

}  // namespace ptc
