#include "tools/bench/scenes/sampled_cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/scene/procedural/city.h"

namespace ptc::bench {
namespace {

/// Random numbers from a counter.
class Numbers {
 public:
  explicit Numbers(std::uint64_t seed = 1) : state_(seed) {}
  double uniform() {
    return static_cast<double>(splitmix64(state_ += kSplitMixStep) >> 11) * 0x1p-53;
  }
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
  }

 private:
  std::uint64_t state_;
};

/// The triangles of a mesh, from which points are drawn.
class Sampler {
 public:
  explicit Sampler(const Mesh& mesh) : mesh_(mesh) {
    double area = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      area += glm::length(glm::cross(edge(t, 1), edge(t, 2))) / 2;
      ends_.push_back(area);
    }
  }
  [[nodiscard]] double area() const { return ends_.empty() ? 0 : ends_.back(); }

  /// Draws a point of a triangle.
  /// @param share  of the area that precedes the triangle, 0 to 1
  SampledPoint draw(double share, Numbers& numbers) const {
    const auto end = std::ranges::upper_bound(ends_, share * area());
    const auto t = static_cast<std::size_t>(
        std::min<std::ptrdiff_t>(end - ends_.begin(), std::ssize(ends_) - 1));
    double u = numbers.uniform(), v = numbers.uniform();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const glm::dvec3 e = edge(t, 1), f = edge(t, 2);
    const glm::dvec3 p = mesh_.origin + corner(t, 0) + u * e + v * f;
    return {.position = p, .origin = p, .normal = glm::vec3(glm::normalize(glm::cross(e, f)))};
  }

 private:
  [[nodiscard]] glm::dvec3 corner(std::size_t t, std::size_t k) const {
    return glm::dvec3(mesh_.positions[mesh_.triangles[t][k]]);
  }
  [[nodiscard]] glm::dvec3 edge(std::size_t t, std::size_t k) const {
    return corner(t, k) - corner(t, 0);
  }

  const Mesh& mesh_;
  std::vector<double> ends_;  ///< area up to each triangle and with it
};

/// Says whether a ray begins in a solid: on its way to the sky it leaves a solid that it has not
/// entered.
bool begins_inside(const RayScene& scene, const glm::dvec3& from, const glm::vec3& ray) {
  constexpr int kMostHits = 64;
  int entered = 0;
  double near = 0;
  for (int i = 0; i < kMostHits && entered >= 0; ++i) {
    const auto hit = scene.closest(from, ray, near, std::numeric_limits<double>::infinity());
    if (!hit) break;
    entered += hit->front ? 1 : -1;
    near = hit->distance + scene.epsilon();
  }
  return entered < 0;
}

/// Says whether a point lies in the open: of pairs of opposite rays from its front side, fewer than
/// half begin in a solid. From the ground below a house, rays downwards say nothing.
bool is_open(const RayScene& scene, const SampledPoint& point, Numbers& numbers) {
  constexpr int kPairs = 8;
  int inside = 0;
  const glm::dvec3 from = point.origin + scene.epsilon() * glm::dvec3(point.normal);
  for (int i = 0; i < kPairs; ++i) {
    const double z = 2 * numbers.uniform() - 1, angle = 2 * std::numbers::pi * numbers.uniform();
    const double across = std::sqrt(1 - z * z);
    const glm::vec3 ray(across * std::cos(angle), across * std::sin(angle), z);
    inside += begins_inside(scene, from, ray) ? 1 : 0;
    inside += begins_inside(scene, from, -ray) ? 1 : 0;
  }
  return inside < kPairs;
}

}  // namespace

double area_of(const Mesh& mesh) {
  return Sampler(mesh).area();
}

std::vector<SampledPoint> sample_at_random(const RayScene& scene, const SampleOptions& options) {
  const Mesh& mesh = scene.mesh();
  // Choose the gaps, and how many points must be drawn so that enough are left
  const Sampler sampler(mesh);
  Numbers numbers;
  const double spacing = std::sqrt(sampler.area() / static_cast<double>(options.points));
  std::vector<glm::dvec3> holes;
  Numbers places;
  for (unsigned i = 0; i < options.holes; ++i)
    holes.push_back(sampler.draw(places.uniform(), places).origin);
  const Bounds bounds = mesh.bounds();
  const double kept = options.ratio > 1 ? (1 - 1 / options.ratio) / std::log(options.ratio) : 1;
  const auto draws =
      static_cast<std::uint64_t>(std::llround(static_cast<double>(options.points) / kept));

  // Draw them
  Numbers directions(2);
  std::vector<SampledPoint> points;
  for (std::uint64_t i = 0; i < draws; ++i) {
    const double share = (static_cast<double>(i) + numbers.uniform()) / static_cast<double>(draws);
    SampledPoint point = sampler.draw(share, numbers);
    if (options.ratio > 1) {
      const double along = (point.origin.x - bounds.low.x) / (bounds.high.x - bounds.low.x);
      if (numbers.uniform() > std::pow(options.ratio, -along)) continue;
    }
    const auto swallows = [&](const glm::dvec3& hole) {
      return glm::distance(hole, point.origin) < 4 * spacing;
    };
    if (std::ranges::any_of(holes, swallows) || !is_open(scene, point, directions)) continue;
    for (int k = 0; k < 3 && options.noise > 0; ++k)
      point.position[k] += options.noise * spacing * numbers.normal();
    points.push_back(point);
  }
  return points;
}

Mesh mesh_of(const SceneChoice& choice, std::uint64_t points, const RunOptions& run) {
  if (choice.file.empty()) {
    // Houses have ledges of a fifth of a metre; 200,000 points lie 8 cm apart
    constexpr std::uint64_t kCityDensity = 16;
    if (choice.name == "city") return city_mesh(points / kCityDensity);
    constexpr std::uint64_t kPerTriangle = 32;  // points on each triangle of the fractal
    return request_scene(choice, {.points = points / kPerTriangle}, run).lit.mesh;
  }
  Progress silent;
  return load_meshes({choice.file}, nullptr, {.backdrop = choice.backdrop}, {}, silent).mesh;
}

}  // namespace ptc::bench
