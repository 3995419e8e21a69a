// Internal to the readers of particle formats (PTC, BGEO, PDB): attributes by the names that
// renderers and animation programs give them.
#pragma once

#include <string_view>
#include <vector>

#include "engine/io/cloud/point_layout.h"

namespace ptc {

/// Appends the fields of an attribute: its parts of the surfel one by one where its name is a known
/// one (P and position; N and normal; radius, radiusPP and pscale; Cd; radiance, _radiosity, Cs and
/// Ci, which are radiance; emission and _emission; albedo and _albedo), else one field for a
/// channel.
/// @param attribute  its name, type, number of components, and what they mean
/// @param offset     of its first number in a packed record, bytes
void add_attribute(const Channel& attribute, std::size_t offset, std::vector<RecordField>& fields);

}  // namespace ptc
