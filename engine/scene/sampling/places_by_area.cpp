#include "engine/scene/sampling/places_by_area.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "engine/scene/sampling/sub_triangle.h"

namespace ptc {

PlacesByArea::PlacesByArea(const RayScene& scene, std::span<const std::uint32_t> triangles,
                           std::uint64_t seed)
    : scene_(scene), triangles_(triangles.begin(), triangles.end()), points_(seed) {
  reached_.reserve(triangles.size());
  for (const std::uint32_t i : triangles)
    reached_.push_back(area() + whole_triangle(scene.mesh(), i).area());
}

SurfaceHit PlacesByArea::place(std::uint32_t index, std::uint32_t count) const {
  const double wanted = area() * (index + 0.5) / count;
  const auto found = std::ranges::lower_bound(reached_, wanted);
  const glm::vec2 square = points_.square(index);
  const float u = std::sqrt(square.x);  // uniform over the triangle
  return scene_.surface(triangles_[static_cast<std::size_t>(found - reached_.begin())],
                        u * (1 - square.y), u * square.y);
}

}  // namespace ptc
