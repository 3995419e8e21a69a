// Shares of a receiver's hemisphere, by formulas.
#pragma once

#include <span>

#include <glm/vec3.hpp>

#include "engine/shade/shading.h"

namespace ptc::bench {

/// Returns the cosine-weighted share of the hemisphere that a flat polygon covers, by Lambert's
/// formula. What lies below the horizon does not count.
/// @param corners  in one plane; a polygon that turns its back to the receiver covers nothing: its
///                 front sees the corners run counter-clockwise
[[nodiscard]] double form_factor(const Receiver& receiver, std::span<const glm::dvec3> corners);

/// Returns the share that a disc covers whose plane is parallel to the receiver's.
/// @param height  of the disc above the receiver, 0 or more
/// @param aside   distance of its centre from the receiver's normal, 0 or more
/// @param radius  above 0; all in the same unit
/// Source: Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-13.
[[nodiscard]] double disc_form_factor(double height, double aside, double radius);

}  // namespace ptc::bench
