#include "engine/shade/reference/cosine_rays.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

/// A stream of uniform numbers in [0, 1): SplitMix64.
class Uniform {
 public:
  explicit Uniform(std::uint64_t seed) : state_(seed) {}
  float operator()() {
    const std::uint64_t bits = splitmix64(state_);
    state_ += kSplitMixStep;
    return static_cast<float>(bits >> 40) * 0x1p-24F;
  }

 private:
  std::uint64_t state_;
};

}  // namespace

unsigned square_side(std::size_t rays) noexcept {
  return static_cast<unsigned>(std::sqrt(static_cast<double>(rays)));
}

void cosine_directions(const glm::vec3& normal, unsigned side, std::uint64_t seed,
                       std::vector<glm::vec3>& directions) {
  const glm::vec3 tangent = glm::normalize(
      glm::cross(normal, std::abs(normal.x) > 0.6F ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0)));
  const glm::vec3 bitangent = glm::cross(normal, tangent);
  Uniform uniform(seed);
  directions.clear();
  directions.reserve(std::size_t{side} * side);
  const auto place = [&](unsigned cell) {  // on an edge of the square [-1, 1]^2
    return 2 * (static_cast<float>(cell) + uniform()) / static_cast<float>(side) - 1;
  };
  for (unsigned j = 0; j < side; ++j) {
    for (unsigned i = 0; i < side; ++i) {
      const float u = place(i), v = place(j);
      // Squares about the middle become circles: the greater coordinate is the radius, which is the
      // sine of the angle to the normal, and their ratio the place on an eighth of the circle
      const bool wide = std::abs(u) > std::abs(v);
      const float sine = wide ? u : v;
      const float turn = sine == 0 ? 0 : kPi / 4 * (wide ? v : u) / sine;
      const float along = sine * std::cos(turn), across = sine * std::sin(turn);
      directions.push_back(tangent * (wide ? along : across) + bitangent * (wide ? across : along) +
                           normal * std::sqrt(std::max(0.0F, 1 - sine * sine)));
    }
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
