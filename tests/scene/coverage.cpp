// Coverage by brute force over a hash grid.
#include "tests/scene/coverage.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"
#include "tests/scene/meshes.h"

namespace ptc {
namespace {

constexpr double kNone = 9;  // spacings

class Neighbours {
 public:
  Neighbours(const std::vector<Surfel>& surfels, double spacing)
      : surfels_(surfels), spacing_(spacing) {
    for (std::uint32_t i = 0; i < surfels.size(); ++i) {
      cells_[key(cell(surfels[i].position))].push_back(i);
    }
  }

  // Calls visit(index, distance in spacings) for the surfels near p that face as `normal` does.
  template <typename Visit>
  void near(const glm::dvec3& p, const glm::vec3& normal, const Visit& visit) const {
    const glm::i64vec3 middle = cell(p);
    for (int k = 0; k < 27; ++k) {
      const auto found =
          cells_.find(key(middle + glm::i64vec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
      if (found == cells_.end()) continue;
      for (const std::uint32_t i : found->second) {
        if (glm::dot(surfels_[i].normal, normal) < 0.26f) continue;
        visit(i, glm::distance(p, surfels_[i].position) / spacing_);
      }
    }
  }

 private:
  [[nodiscard]] glm::i64vec3 cell(const glm::dvec3& p) const {
    return glm::i64vec3(glm::floor(p / (1.5 * spacing_)));
  }
  static std::uint64_t key(const glm::i64vec3& c) {
    return splitmix64(
        splitmix64(splitmix64(static_cast<std::uint64_t>(c.x)) ^ static_cast<std::uint64_t>(c.y)) ^
        static_cast<std::uint64_t>(c.z));
  }

  const std::vector<Surfel>& surfels_;
  double spacing_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

void measure_distances(const std::vector<Surfel>& surfels, const Neighbours& neighbours,
                       Coverage& result) {
  double sum = 0;
  double squares = 0;
  result.nearest_least = kNone;
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    double nearest = kNone;
    neighbours.near(surfels[i].position, surfels[i].normal, [&](std::uint32_t k, double distance) {
      if (k != i) nearest = std::min(nearest, distance);
    });
    sum += nearest;
    squares += nearest * nearest;
    result.nearest_least = std::min(result.nearest_least, nearest);
  }
  const auto count = static_cast<double>(surfels.size());
  result.nearest_mean = sum / count;
  result.nearest_deviation =
      std::sqrt(std::max(0.0, squares / count - result.nearest_mean * result.nearest_mean));
}

}  // namespace

Coverage measure_coverage(const Mesh& mesh, const std::vector<Surfel>& surfels, double spacing,
                          int probes) {
  Coverage result;
  const Neighbours neighbours(surfels, spacing);
  measure_distances(surfels, neighbours, result);
  std::vector<double> ends;
  double total = 0;
  for (const auto& t : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[t[0]]);
    total += glm::length(
        glm::cross(glm::dvec3(mesh.positions[t[1]]) - a, glm::dvec3(mesh.positions[t[2]]) - a));
    ends.push_back(total);
  }
  Random random(99);
  int uncovered = 0;
  for (int i = 0; i < probes; ++i) {
    const double at = (i + random.unit()) / probes * total;
    const auto& t = mesh.triangles[static_cast<std::size_t>(
        std::min(std::lower_bound(ends.begin(), ends.end(), at), ends.end() - 1) - ends.begin())];
    const glm::dvec3 a(mesh.positions[t[0]]);
    const glm::dvec3 ab = glm::dvec3(mesh.positions[t[1]]) - a;
    const glm::dvec3 ac = glm::dvec3(mesh.positions[t[2]]) - a;
    const double root = std::sqrt(random.unit());
    const double v = root * random.unit();
    bool is_covered = false;
    double nearest = kNone;
    neighbours.near(mesh.origin + a + (root - v) * ab + v * ac,
                    glm::vec3(glm::normalize(glm::cross(ab, ac))), [&](std::uint32_t k, double d) {
                      nearest = std::min(nearest, d);
                      is_covered |= d * spacing <= static_cast<double>(surfels[k].radius);
                    });
    if (!is_covered) ++uncovered;
    result.largest_hole = std::max(result.largest_hole, nearest);
  }
  result.uncovered = static_cast<double>(uncovered) / probes;
  return result;
}

double covered_area(const std::vector<Surfel>& surfels) {
  double area = 0;
  for (const Surfel& s : surfels)
    area += 2 * static_cast<double>(s.radius) * static_cast<double>(s.radius);
  return area;
}

}  // namespace ptc
