#include "engine/shade/reference/cosine_rays.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/base/numbers.h"

namespace ptc {
namespace {

/// Tiles of the square, row after row. Rows go to and fro, so that tiles that follow one another
/// touch. Each is twice as wide as it is high, in the square's units of one direction.
class Tiles {
 public:
  explicit Tiles(std::size_t count)
      : columns_(whole(std::sqrt(static_cast<double>(count) / (2.0 * kDirectionTile)))),
        rows_(whole(static_cast<double>(count) / kDirectionTile / columns_)) {}

  [[nodiscard]] std::size_t count() const noexcept { return std::size_t{columns_} * rows_; }
  [[nodiscard]] std::size_t of(const glm::vec2& point) const noexcept {
    const auto column = static_cast<unsigned>(point.x * static_cast<float>(columns_)),
               row = static_cast<unsigned>(point.y * static_cast<float>(rows_));
    return std::size_t{row} * columns_ + (row & 1 ? columns_ - 1 - column : column);
  }

 private:
  static unsigned whole(double number) {
    return std::max(1U, static_cast<unsigned>(std::lround(number)));
  }

  unsigned columns_, rows_;
};

/// Takes a point of the square to the unit disc. Squares about the middle become circles: the
/// greater coordinate is the radius, which is the sine of the angle to the normal, and their ratio
/// the place on an eighth of the circle.
glm::vec2 concentric(const glm::vec2& point) {
  const float u = 2 * point.x - 1, v = 2 * point.y - 1;
  const bool wide = std::abs(u) > std::abs(v);
  const float sine = wide ? u : v;
  const float turn = sine == 0 ? 0 : kPi / 4 * (wide ? v : u) / sine;
  const float along = sine * std::cos(turn), across = sine * std::sin(turn);
  return wide ? glm::vec2(along, across) : glm::vec2(across, along);
}

}  // namespace

void cosine_directions(const glm::vec3& normal, std::size_t count, std::uint64_t seed,
                       std::vector<glm::vec3>& directions) {
  // Count the points of each tile
  const SquarePoints points(seed);
  const Tiles tiles(count);
  thread_local std::vector<glm::vec2> square;
  thread_local std::vector<std::uint32_t> begins;
  square.resize(count);
  begins.assign(tiles.count() + 1, 0);
  for (std::size_t i = 0; i < count; ++i) {
    square[i] = points.square(static_cast<std::uint32_t>(i));
    ++begins[tiles.of(square[i]) + 1];
  }
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  // Put their directions in order
  const glm::vec3 tangent = glm::normalize(
      glm::cross(normal, std::abs(normal.x) > 0.6F ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0)));
  const glm::vec3 bitangent = glm::cross(normal, tangent);
  directions.resize(count);
  for (const glm::vec2& point : square) {
    const glm::vec2 disc = concentric(point);
    directions[begins[tiles.of(point)]++] =
        tangent * disc.x + bitangent * disc.y +
        normal * std::sqrt(std::max(0.0F, 1 - glm::dot(disc, disc)));
  }
}

Shading sum_rays(const Receiver& receiver, std::span<const glm::vec3> directions,
                 std::span<const DiscHit> hits,
                 const std::function<glm::vec3(const glm::vec3&)>& sky_at) {
  unsigned covered = 0;
  glm::dvec3 light(0), sky(0), open(0);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    if (hits[i].met()) {
      ++covered;
      light += hits[i].radiance;
    } else {
      open += directions[i];
      if (sky_at) sky += sky_at(directions[i]);
    }
  }
  // Turn the sums into means over the hemisphere, whose cosine-weighted measure is pi.
  const auto count = static_cast<double>(directions.size());
  Shading shading;
  shading.occlusion = static_cast<float>(covered / count);
  shading.irradiance = glm::vec3(light * (std::numbers::pi / count));
  shading.sky = glm::vec3(sky * (std::numbers::pi / count));
  const double length = glm::length(open);
  shading.bent_normal = length > 0 ? glm::vec3(open / length) : receiver.normal;
  return shading;
}

}  // namespace ptc
