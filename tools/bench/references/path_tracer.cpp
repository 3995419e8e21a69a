// Unidirectional path tracing. At each surface the emitters are asked in two ways, whose densities
// over the solid angle are known for both:
//
//   a place on an emitter   chance of its triangle / area * distance^2 / cosine there
//   a cosine ray            cosine here / pi
//
// so each contribution is weighed by its own density over the sum of both (Veach and Guibas 1995,
// the balance heuristic).
//
// The numbers of a path's first surface come from additive recurrences whose steps are powers of
// the roots of x^(d + 1) = x + 1 (Roberts 2018), shifted at random for each pixel and half: they
// are spread evenly over the paths of the pixel, and each of them is uniform. Those of further
// surfaces are independent.
#include "tools/bench/references/path_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"

namespace ptc::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A stream of independent numbers in [0, 1).
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : state_(splitmix64(seed)) {}
  double next() {
    state_ += kSplitMixStep;
    return static_cast<double>(splitmix64(state_) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

/// The numbers that one surface of a path takes.
struct SurfaceNumbers {
  std::array<double, 2> ray;      ///< direction of the cosine ray
  std::array<double, 3> emitter;  ///< triangle, and the place on it
};

double fraction(double x) {
  return x - std::floor(x);
}

/// The numbers of the first surfaces of all paths of one half of a pixel.
class SpreadNumbers {
 public:
  explicit SpreadNumbers(RandomNumbers& random) {
    for (double& shift : shifts_) shift = random.next();
  }
  [[nodiscard]] SurfaceNumbers of(unsigned path) const {
    const auto spread = [&](std::size_t shift, double step) {
      return fraction(shifts_[shift] + step * static_cast<double>(path));
    };
    return {{spread(0, 0.7548776662466927), spread(1, 0.5698402909980532)},
            {spread(2, 0.8191725133961645), spread(3, 0.6710436067037893),
             spread(4, 0.5497004779019703)}};
  }

 private:
  std::array<double, 5> shifts_{};
};

/// Returns a direction whose density is in proportion to its cosine to a normal: a point of the
/// sphere that touches the surface.
glm::vec3 cosine_ray(const glm::vec3& normal, const std::array<double, 2>& numbers) {
  const double z = 1 - 2 * numbers[0], turn = 2 * std::numbers::pi * numbers[1];
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  const glm::vec3 sum = normal + glm::vec3(r * std::cos(turn), r * std::sin(turn), z);
  const float length = glm::length(sum);
  return length > 1e-6F ? sum / length : normal;
}

/// Returns a direction within a cap around an axis, uniform over its solid angle.
glm::vec3 cap_ray(const glm::vec3& axis, double angle, RandomNumbers& random) {
  const double z = 1 - random.next() * (1 - std::cos(angle));
  const double turn = 2 * std::numbers::pi * random.next();
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  const glm::vec3 other = std::abs(axis.x) < 0.5F ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
  const glm::vec3 u = glm::normalize(glm::cross(axis, other)), v = glm::cross(axis, u);
  return glm::normalize(static_cast<float>(r * std::cos(turn)) * u +
                        static_cast<float>(r * std::sin(turn)) * v + static_cast<float>(z) * axis);
}

/// A place where a path is reflected.
struct Place {
  glm::dvec3 position{0};  ///< a little off the surface, scene units
  glm::vec3 normal{0};     ///< shading normal, towards the incoming ray
  glm::vec3 plane{0};      ///< normal of the triangle on the same side
};

/// The emissive triangles of a mesh, chosen in proportion to area times emission.
class EmitterChoice {
 public:
  explicit EmitterChoice(const Mesh& mesh) : chances_(mesh.triangles.size()) {
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const glm::vec3& light = mesh.materials[mesh.material_of[i]].emission;
      const auto& [a, b, c] = mesh.triangles[i];
      const glm::dvec3 p(mesh.positions[a]);
      const double area = 0.5 * glm::length(glm::cross(glm::dvec3(mesh.positions[b]) - p,
                                                       glm::dvec3(mesh.positions[c]) - p));
      const double power = area * static_cast<double>(std::max({light.x, light.y, light.z}));
      if (power <= 0) continue;
      total_ += power;
      sums_.push_back(total_);
      triangles_.push_back(static_cast<std::uint32_t>(i));
      chances_[i] = power / area;  // of a unit of its area, times the total
    }
  }
  [[nodiscard]] bool empty() const { return triangles_.empty(); }
  /// The density over area by which places of a triangle are chosen, 1 / square unit.
  [[nodiscard]] double density(std::uint32_t triangle) const {
    return total_ > 0 ? chances_[triangle] / total_ : 0;
  }
  /// Chooses a place on an emitter.
  [[nodiscard]] SurfaceHit place(const RayScene& scene,
                                 const std::array<double, 3>& numbers) const {
    const auto found = std::ranges::upper_bound(sums_, numbers[0] * total_);
    const auto at = std::min<std::size_t>(static_cast<std::size_t>(found - sums_.begin()),
                                          triangles_.size() - 1);
    const double root = std::sqrt(numbers[1]);
    return scene.surface(triangles_[at], static_cast<float>(root * (1 - numbers[2])),
                         static_cast<float>(root * numbers[2]));
  }

 private:
  std::vector<double> chances_;  ///< for each triangle of the mesh
  std::vector<double> sums_;
  std::vector<std::uint32_t> triangles_;
  double total_ = 0;
};

/// Follows paths through a scene.
class PathTracer {
 public:
  PathTracer(const RayScene& scene, const LightRig& lights, unsigned reflections)
      : scene_(scene),
        lights_(lights),
        emitters_(scene.mesh()),
        step_(2 * scene.epsilon()),
        reflections_(reflections) {}

  /// Returns the radiance that a path finds at its beginning.
  /// @param first  numbers of the surface that the ray meets
  [[nodiscard]] glm::vec3 trace(glm::dvec3 origin, glm::vec3 direction, const SurfaceNumbers& first,
                                RandomNumbers& random) const {
    glm::vec3 sum(0), share(1);
    double density = 0;  // over the solid angle, of the cosine ray on which the path came
    for (unsigned reflected = 0;; ++reflected) {
      const auto hit = scene_.closest(origin, direction, 0, kInfinity);
      if (!hit) return sum + share * lights_.sky.at(direction);
      if (hit->front && hit->emission != glm::vec3(0))
        sum += share * hit->emission * (reflected == 0 ? 1 : weight_of(*hit, direction, density));
      const bool lit = hit->front || reflected == 0 || is_double_sided(hit->triangle);
      if (!lit || reflected == reflections_) return sum;

      // Reflect the light of lamps, then go on. Rays begin off the surface and a little back
      // towards where the path came from, which is clear of both walls where it met their edge.
      const float turn = hit->front ? 1.0F : -1.0F;
      const glm::vec3 plane = turn * hit->geometric_normal;
      const Place place{hit->position + step_ * glm::dvec3(plane - direction), turn * hit->normal,
                        plane};
      const SurfaceNumbers numbers =
          reflected == 0 ? first
                         : SurfaceNumbers{{random.next(), random.next()},
                                          {random.next(), random.next(), random.next()}};
      share *= hit->albedo;
      sum += share * std::numbers::inv_pi_v<float> *
             (from_emitters(place, numbers) + from_lamps(place, random));
      direction = cosine_ray(place.normal, numbers.ray);
      if (glm::dot(direction, plane) <= 0) return sum;
      origin = place.position;
      density = cosine(place.normal, direction) * std::numbers::inv_pi;
    }
  }

 private:
  static double cosine(const glm::vec3& a, const glm::vec3& b) {
    return static_cast<double>(glm::dot(a, b));
  }
  [[nodiscard]] bool is_double_sided(std::uint32_t triangle) const {
    return scene_.mesh().materials[scene_.mesh().material_of[triangle]].double_sided;
  }
  /// The density over the solid angle by which from_emitters() chooses a place.
  [[nodiscard]] double emitter_density(std::uint32_t triangle, double distance,
                                       double cosine_there) const {
    return emitters_.density(triangle) * distance * distance / std::max(cosine_there, 1e-12);
  }
  /// The weight of an emitter that a cosine ray met.
  [[nodiscard]] float weight_of(const SurfaceHit& hit, const glm::vec3& direction,
                                double density) const {
    const double other =
        emitter_density(hit.triangle, hit.distance, -cosine(hit.geometric_normal, direction));
    return static_cast<float>(density / (density + other));
  }
  /// Says whether nothing is in the way from a place to another, scene units.
  [[nodiscard]] bool sees(const Place& place, const glm::dvec3& end) const {
    const glm::dvec3 way = end - place.position;
    const double distance = glm::length(way);
    return !scene_.occluded(place.position, glm::vec3(way / distance), 0, distance);
  }
  /// Irradiance from one place of the emitters, weighed against the cosine ray, W/m^2.
  [[nodiscard]] glm::vec3 from_emitters(const Place& place, const SurfaceNumbers& numbers) const {
    if (emitters_.empty()) return glm::vec3(0);
    const SurfaceHit lamp = emitters_.place(scene_, numbers.emitter);
    const glm::dvec3 way = lamp.position - place.position;
    const double distance = glm::length(way);
    if (distance <= 0) return glm::vec3(0);
    const glm::vec3 direction(way / distance);
    const double here = cosine(place.normal, direction),
                 there = -cosine(lamp.geometric_normal, direction);
    if (here <= 0 || there <= 0 || glm::dot(place.plane, direction) <= 0) return glm::vec3(0);
    if (!sees(place, lamp.position + step_ * glm::dvec3(lamp.geometric_normal)))
      return glm::vec3(0);
    const double density = emitter_density(lamp.triangle, distance, there);
    const double weighed = here / (density + here * std::numbers::inv_pi);
    return lamp.emission * static_cast<float>(weighed);
  }
  /// Irradiance from suns, point lights and spot lights, W/m^2.
  [[nodiscard]] glm::vec3 from_lamps(const Place& place, RandomNumbers& random) const {
    glm::vec3 sum(0);
    for (const Sun& sun : lights_.suns) {
      const glm::vec3 direction =
          cap_ray(sun.to_sun, static_cast<double>(sun.angular_radius), random);
      const float here = glm::dot(place.normal, direction);
      if (here <= 0 || glm::dot(place.plane, direction) <= 0) continue;
      if (!scene_.occluded(place.position, direction, 0, kInfinity)) sum += here * sun.irradiance;
    }
    const auto add = [&](const glm::dvec3& lamp, const glm::vec3& intensity) {
      const glm::dvec3 way = lamp - place.position;
      const double square = glm::dot(way, way);
      if (square <= 0) return;
      const glm::vec3 direction(way / std::sqrt(square));
      const float here = glm::dot(place.normal, direction);
      if (here <= 0 || glm::dot(place.plane, direction) <= 0 || !sees(place, lamp)) return;
      sum += here * intensity / static_cast<float>(square);
    };
    for (const PointLight& point : lights_.points) add(point.position, point.intensity);
    for (const SpotLight& spot : lights_.spots)
      add(spot.position, spot.intensity * static_cast<float>(spot_share(spot, place.position)));
    return sum;
  }

  const RayScene& scene_;
  const LightRig& lights_;
  EmitterChoice emitters_;
  double step_;  ///< by which rays begin off a surface, scene units
  unsigned reflections_;
};

}  // namespace

PathPicture trace_paths(const RayScene& scene, const LightRig& lights, const Camera& camera,
                        const PathOptions& options, const Executor& executor, Progress& progress) {
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  const unsigned samples = options.side * options.side;
  const unsigned half = std::max(1U, (options.paths / 2 + samples - 1) / samples) * samples;
  const PathTracer tracer(scene, lights, options.reflections);
  PathPicture picture{std::vector<glm::vec3>(pixels), std::vector<glm::vec3>(pixels),
                      std::vector<char>(pixels, 1)};
  const auto ray = [&](std::size_t pixel, unsigned sample) {
    const auto along = [&](std::size_t at, unsigned sub) {
      return static_cast<float>(at) +
             (static_cast<float>(sub) + 0.5F) / static_cast<float>(options.side);
    };
    return camera.direction(along(pixel % camera.width, sample % options.side),
                            along(pixel / camera.width, sample / options.side));
  };
  progress.begin("paths", camera.height, "rows");
  executor.for_each(camera.height, [&](std::size_t row, unsigned) {
    for (std::size_t pixel = row * camera.width; pixel < (row + 1) * camera.width; ++pixel) {
      // Find what the pixel shows
      for (unsigned sample = 0; sample < samples; ++sample) {
        const auto hit = scene.closest(camera.position, ray(pixel, sample), 0, kInfinity);
        if (!hit || hit->emission != glm::vec3(0)) picture.judged[pixel] = 0;
      }
      // Trace both halves
      for (auto* of_half : {&picture.a, &picture.b}) {
        RandomNumbers random(2 * pixel + (of_half == &picture.a ? 0 : 1));
        const SpreadNumbers spread(random);
        glm::dvec3 sum(0);
        for (unsigned path = 0; path < half; ++path) {
          sum += glm::dvec3(
              tracer.trace(camera.position, ray(pixel, path % samples), spread.of(path), random));
        }
        (*of_half)[pixel] = glm::vec3(sum / static_cast<double>(half));
      }
    }
    progress.advance(1);
  });
  progress.end();
  return picture;
}

}  // namespace ptc::bench
