// The second pass over the inputs of a build, which sorts their points.
#pragma once

#include <cstdint>

#include "engine/base/error.h"
#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/scene/sampling/streamed_sampler.h"
#include "engine/sort/external_sort.h"

namespace ptc {

/// Thrown when a point lies beyond the bounds that its file says. The build must measure the points
/// themselves.
class BoundsExceeded : public DataError {
 public:
  using DataError::DataError;
};

/// What the sampling of meshes may use.
struct SamplingRoom {
  unsigned at_once = 0;     ///< patches of a mesh in memory, as for sample_mesh()
  StreamingRoom streaming;  ///< of meshes on the disk
};

/// Feeds the surfels of all inputs to the sort, and what is recorded of them beyond that to the
/// sorts of attributes. Meshes are sampled and lit on the way, and freed afterwards.
/// @param first  number of points that the container has before these
/// @param room    for sampling
/// @return  distance between neighbouring surfels on the meshes, scene units; 0 without meshes
/// @throws BoundsExceeded; DataError when a cloud changed since it was measured; std::system_error
double feed_inputs(BuildInputs& inputs, const BuildRequest& request, const Frame& frame,
                   std::uint64_t first, const SamplingRoom& room, ExternalSorter& sorter,
                   AttributeSorts& attributes, const Executor& executor, Progress& progress);

}  // namespace ptc
