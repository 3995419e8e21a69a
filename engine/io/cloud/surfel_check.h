// Internal to the point readers: the rules that every surfel from a file must keep.
#pragma once

#include <cmath>
#include <string>

#include "engine/base/surfel.h"
#include "engine/io/cloud/points.h"

namespace ptc {

/// A surfel as its file has it, before it is rounded and its normal is normalised; the members are
/// those of Surfel.
struct RawSurfel {
  glm::dvec3 position{0};
  glm::dvec3 normal{0};
  double radius = 0;
  glm::dvec3 radiance{0};
  glm::dvec3 emission{0};
  glm::dvec3 albedo{0.5};
};

/// Says whether a component is not a number.
[[nodiscard]] inline bool has_nan(const glm::dvec3& v) {
  return std::isnan(v.x) || std::isnan(v.y) || std::isnan(v.z);
}

/// Checks a surfel and converts it to `out`.
/// @return the rule that `raw` breaks, or an empty string when it breaks none
[[nodiscard]] std::string convert_surfel(const RawSurfel& raw, bool has_normals, Surfel& out);

}  // namespace ptc
