#include "tools/bench/shapes/surfels.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/io/cloud/record.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/writer.h"

namespace ptc::bench {

std::size_t VectorStream::next(std::span<PointRecord> out) {
  const std::size_t count = std::min({out.size(), block_, records_.size() - at_});
  std::copy_n(records_.begin() + static_cast<std::ptrdiff_t>(at_), count, out.begin());
  at_ += count;
  return count;
}

SortedScene sort_scene(const std::vector<Surfel>& surfels) {
  SortedScene scene;
  Bounds bounds;
  for (const Surfel& s : surfels) bounds.add(s.position);
  if (surfels.empty()) return scene;
  scene.frame = frame_around({bounds.low.x, bounds.low.y, bounds.low.z},
                             {bounds.high.x, bounds.high.y, bounds.high.z});
  for (const Surfel& s : surfels) scene.records.push_back(to_record(s, scene.frame));
  std::ranges::stable_sort(scene.records, {}, &PointRecord::key);
  return scene;
}

void write_scene(const std::filesystem::path& target, const std::vector<Surfel>& surfels,
                 const BuildOptions& options, std::uint8_t page_shift, Codec codec) {
  SortedScene scene = sort_scene(surfels);
  const bool emits = std::ranges::any_of(
      surfels, [](const Surfel& surfel) { return surfel.emission != glm::vec3(0); });
  ContainerWriter writer(target, {.page_shift = page_shift,
                                  .codec = codec,
                                  .frame = scene.frame,
                                  .point_bytes = emits ? kEmittingPointBytes : kPointBytes});
  VectorStream stream(std::move(scene.records));
  Progress silent;
  const Superblock superblock = build_pages(stream, writer, options, ThreadPool(), silent);
  writer.finish({}, superblock);
}

void add_rectangle(std::vector<Surfel>& surfels, const glm::dvec3& corner, const glm::dvec3& edge_u,
                   const glm::dvec3& edge_v, double spacing, const glm::vec3& radiance) {
  const auto cells = [&](const glm::dvec3& e) {
    return std::max(1, static_cast<int>(std::ceil(glm::length(e) / spacing)));
  };
  const int nu = cells(edge_u), nv = cells(edge_v);
  const glm::dvec3 du = edge_u / static_cast<double>(nu), dv = edge_v / static_cast<double>(nv);
  const glm::vec3 normal(glm::normalize(glm::cross(edge_u, edge_v)));
  const float radius = static_cast<float>(0.5 * std::sqrt(glm::dot(du, du) + glm::dot(dv, dv)));
  for (int j = 0; j < nv; ++j) {
    for (int i = 0; i < nu; ++i) {
      surfels.push_back({.position = corner + du * (i + 0.5) + dv * (j + 0.5),
                         .normal = normal,
                         .radius = radius,
                         .radiance = radiance,
                         .albedo = glm::vec3(0.5F)});
    }
  }
}

void add_sphere(std::vector<Surfel>& surfels, const glm::dvec3& centre, double radius,
                double spacing, const glm::vec3& radiance) {
  const int count =
      std::max(8, static_cast<int>(4 * std::numbers::pi * radius * radius / (spacing * spacing)));
  const double area = 4 * std::numbers::pi * radius * radius / count;
  for (int i = 0; i < count; ++i) {  // Fibonacci lattice
    const double z = 1 - 2 * (i + 0.5) / count, ring = std::sqrt(1 - z * z),
                 turn = i * 2.399963229728653;
    const glm::dvec3 n(ring * std::cos(turn), ring * std::sin(turn), z);
    surfels.push_back({.position = centre + n * radius,
                       .normal = glm::vec3(n),
                       .radius = static_cast<float>(std::sqrt(area / 2)),
                       .radiance = radiance,
                       .albedo = glm::vec3(0.5F)});
  }
}

std::vector<Surfel> small_scene(double spacing) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, spacing, glm::vec3(0.5F));
  add_rectangle(surfels, {-2, 1.5, 0}, {4, 0, 0}, {0, 0, 2}, spacing, {0.8F, 0.1F, 0.1F});
  for (int i = 0; i < 8; ++i) {
    add_sphere(surfels, {-1.5 + 0.4 * i, -1 + 0.3 * (i * 5 % 8), 0.3 + 0.1 * (i % 3)},
               0.2 + 0.03 * (i % 4), spacing, {0.2F + 0.08F * static_cast<float>(i), 0.6F, 0.3F});
  }
  return surfels;
}

std::vector<Surfel> random_surfels(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 bits(seed);
  const auto uniform = [&] { return static_cast<double>(bits() >> 11) * 0x1p-53; };
  std::vector<Surfel> surfels;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 2 * uniform() - 1, turn = 2 * std::numbers::pi * uniform(),
                 ring = std::sqrt(1 - z * z);
    surfels.push_back({.position = {uniform(), uniform(), uniform()},
                       .normal = glm::vec3(ring * std::cos(turn), ring * std::sin(turn), z),
                       .radius = static_cast<float>(0.001 + 0.01 * uniform()),
                       .radiance = glm::vec3(uniform(), uniform(), uniform()),
                       .albedo = glm::vec3(0.5F)});
  }
  return surfels;
}

}  // namespace ptc::bench
