// Rules for appending points to a container (build_container.h, BuildRequest::append).
#pragma once

#include "engine/octree/rounding.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/store/reader.h"

namespace ptc {

/// Checks that points can be appended to a scene: it must have no channels of shading, and no
/// feature that forbids changes.
/// @throws DataError with the reason
void check_extensible(const ContainerReader& scene);

/// Sets BuildRequest::profile to the profile that the scene was built with, as far as its pages
/// and its record show it. A scene without points and without a record of rounding leaves the
/// request as it is.
void adopt_profile(BuildRequest& request, const ContainerReader& scene);
/// Sets BuildRequest::page_shift to the page size of the scene.
void adopt_page_size(BuildRequest& request, const ContainerReader& scene);
/// Sets BuildOptions::leaf_points to the maximum of points in a leaf of the scene, at least 1.
void adopt_leaves(BuildRequest& request, const ContainerReader& scene);

/// Returns the record of a scene to which points were appended. Entries of the scene win; names of
/// inputs are joined, and a spacing is kept only when both records have the same. The channels are
/// those of `added`, which has those of the scene among them.
[[nodiscard]] Meta extended_meta(const Meta& scene, const Meta& added);

}  // namespace ptc
