#include "engine/octree/cluster_sums.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "format/morton.h"
#include "format/scalar.h"

namespace ptc {
namespace {

// The least reach of surfels from their mean, over the radius of a disc of their area. It is 1 in a
// square and 0.88 in a hexagon; surfels that lie over each other reach less far.
constexpr double kDensest = 0.9;

glm::dvec3 colour_of(const Half3& half) {
  return {decode_half(half[0]), decode_half(half[1]), decode_half(half[2])};
}

Half3 to_halves(const glm::dvec3& colour) {
  const glm::vec3 c(colour);
  return {encode_half(c.x), encode_half(c.y), encode_half(c.z)};
}

}  // namespace

void ColourSums::add(const glm::dvec3& value, double area) {
  first += area * value;
  second += area * value * value;
}

void ColourSums::add(const ColourSums& other) {
  first += other.first;
  second += other.second;
}

double ColourSums::change(double area) const {
  return std::max(0.0, square() - glm::dot(first, first) / area);
}

bool ColourSums::is_even(double area, double contrast) const {
  const glm::dvec3 mean = first / area, variance = second / area - mean * mean;
  const double brightest = std::max({mean.x, mean.y, mean.z});
  constexpr double kRounding = 1e-12;  // what it leaves of equal values
  return std::max({variance.x, variance.y, variance.z}) <=
         (contrast * contrast + kRounding) * brightest * brightest;
}

ClusterSums::ClusterSums(const PointRecord& point, double unit)
    : reach(double{point.radius} / unit), least(reach) {
  area = 2 * reach * reach;
  const LatticePoint at = decode_morton(point.key);
  mean = {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])};
  const auto n = decode_octahedral_f64(point.normal[0], point.normal[1]);
  const glm::dvec3 normal(n[0], n[1], n[2]);
  facing = area * normal;
  spread = area * area / 12 * (glm::dmat3(1) - glm::outerProduct(normal, normal));
  radiance.add(colour_of(point.radiance), area);
  emission.add(colour_of(point.emission), area);
  albedo.add({point.albedo[0], point.albedo[1], point.albedo[2]}, area);
}

void ClusterSums::add(const ClusterSums& other) {
  const double sum = area + other.area;
  const glm::dvec3 way = other.mean - mean;
  spread += other.spread + area * other.area / sum * glm::outerProduct(way, way);
  mean += other.area / sum * way;
  facing += other.facing;
  area = sum;
  count += other.count;
  least = std::min(least, other.least);
  radiance.add(other.radiance);
  emission.add(other.emission);
  albedo.add(other.albedo);
}

double ClusterSums::covered() const {
  return glm::length(facing);
}

double ClusterSums::finest() const {
  return std::sqrt(area / static_cast<double>(count) / 2);
}

bool ClusterSums::is_flat(const Flatness& most) const {
  const double one = covered();
  if (!(1 - one / area <= most.turn * most.turn / 2)) return false;
  if (std::sqrt(area / 2) > most.growth * finest()) return false;
  const glm::dvec3 normal = facing / one;
  const double height = most.height * finest();
  return glm::dot(normal, spread * normal) <= height * height * area &&
         radiance.is_even(area, most.contrast) && emission.is_even(area, most.contrast) &&
         albedo.is_even(area, most.contrast);
}

bool ClusterSums::is_round(const Flatness& most) const {
  const double radius = std::sqrt(covered() / 2);
  return reach >= kDensest * radius && reach <= most.reach * radius;
}

PointRecord ClusterSums::surfel(PointRecord like, int level, double unit) const {
  // The mean lies in the cell, but for what sums of doubles round
  const LatticePoint low = decode_morton(cell_of(like.key, level));
  const std::uint64_t last = (std::uint64_t{1} << (kLatticeBits - level)) - 1;
  LatticePoint at;
  for (std::size_t k = 0; k < 3; ++k) {
    const double of_k = std::max(mean[static_cast<int>(k)], 0.0);
    at[k] = std::clamp(static_cast<std::uint64_t>(of_k), low[k], low[k] + last);
  }
  like.key = encode_morton(at);
  like.radius = static_cast<float>(std::sqrt(covered() / 2) * unit);
  const glm::vec3 normal(facing / covered());
  like.normal = encode_octahedral({normal.x, normal.y, normal.z});
  like.radiance = to_halves(radiance.first / area);
  like.emission = to_halves(emission.first / area);
  for (int k = 0; k < 3; ++k) {
    like.albedo[static_cast<std::size_t>(k)] =
        static_cast<std::uint8_t>(std::lround(albedo.first[k] / area));
  }
  return like;
}

MergeCounts ClusterSums::counts(bool one) const {
  MergeCounts counts{.points = count,
                     .light_square = radiance.square() + emission.square(),
                     .albedo_square = albedo.square()};
  if (!one) return counts;
  counts.merged = count;
  counts.made = 1;
  counts.light_change = radiance.change(area) + emission.change(area);
  counts.albedo_change = albedo.change(area);
  return counts;
}

}  // namespace ptc
