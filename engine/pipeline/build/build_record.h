// What a container records of its build: the texts and channels of its meta page, and its UUID.
#pragma once

#include <cstdint>
#include <span>

#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/sort/records_digest.h"
#include "format/schema.h"

namespace ptc {

/// Returns the record of the inputs and the request, without the spacing of the surfels.
[[nodiscard]] Meta make_meta(const BuildRequest& request, const BuildInputs& inputs);

/// Returns the record for the meta page.
/// @param meta        from make_meta(), with any channels that were added to it
/// @param spacing     between the surfels on meshes, scene units; 0: not known, or no meshes
/// @param scene       record of the container that the points are appended to; null: none
/// @param page_shift  logarithm to the base 2 of the bytes of a page; the names of the inputs are
///                    cut to a quarter of a page
[[nodiscard]] Meta complete_record(Meta meta, double spacing, const Meta* scene,
                                   std::uint8_t page_shift);

/// Returns the UUID of a container. Equal points, settings and record give an equal file, so they
/// are all that the UUID is made of.
/// @param points      digest of the points, in any order
/// @param attributes  digests of their values, group after group
/// @param scene       UUID of the container that the points are appended to; zeros when there is
///                    none
[[nodiscard]] Uuid content_uuid(const RecordsDigest& points,
                                std::span<const RecordsDigest> attributes, const Frame& frame,
                                const BuildRequest& request, const Meta& meta, const Uuid& scene);

}  // namespace ptc
