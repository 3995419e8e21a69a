// Inside the point readers: the rules that every surfel from a file has to meet.
#pragma once

#include <string>

#include "engine/base/surfel.h"
#include "engine/io/cloud/points.h"

namespace ptc {

/// A surfel as its file has it, before it is rounded and its normal scaled.
struct RawSurfel {
  glm::dvec3 position{0};
  glm::dvec3 normal{0};
  double radius = 0;
  glm::dvec3 radiance{0};
  glm::dvec3 albedo{0.5};
};

/// Sets `out`. @return the rule that `raw` breaks, empty when there is none
[[nodiscard]] std::string convert_surfel(const RawSurfel& raw, bool has_normals, Surfel& out);

/// XYZ text.
[[nodiscard]] PointFile open_xyz(const std::filesystem::path& path);

}  // namespace ptc
