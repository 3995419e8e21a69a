// Points added to a container (engine/ptc.h, BuildRequest::append).
#pragma once

#include "engine/octree/rounding.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/store/reader.h"

namespace ptc {

/// @throws DataError when points cannot be added to the scene, with the reason
void check_extensible(const ContainerReader& scene);

/// Lets a request keep what the scene was made with: profile, page size, leaves.
void adopt_profile(BuildRequest& request, const ContainerReader& scene);
void adopt_page_size(BuildRequest& request, const ContainerReader& scene);
void adopt_leaves(BuildRequest& request, const ContainerReader& scene);

/// The record of a scene with that of the points added to it.
[[nodiscard]] Meta extended_meta(const Meta& scene, const Meta& added);

}  // namespace ptc
