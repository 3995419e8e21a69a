// Surfels of simple shapes, and containers of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/octree/build_pages.h"
#include "engine/sort/external_sort.h"

namespace ptc::bench {

/// A stream of the records of a vector, at most `block` at a time.
class VectorStream : public PointStream {
 public:
  explicit VectorStream(std::vector<PointRecord> records, std::size_t block = 1000)
      : records_(std::move(records)), block_(block) {}
  std::size_t next(std::span<PointRecord> out) override;

 private:
  std::vector<PointRecord> records_;
  std::size_t block_;
  std::size_t at_ = 0;
};

/// Surfels as sorted records in the smallest frame around them.
struct SortedScene {
  Frame frame;
  std::vector<PointRecord> records;
};
[[nodiscard]] SortedScene sort_scene(const std::vector<Surfel>& surfels);

/// Writes the surfels to a container, whose points have emission when a surfel emits light.
void write_scene(const std::filesystem::path& target, const std::vector<Surfel>& surfels,
                 const BuildOptions& options = {}, std::uint8_t page_shift = 12,
                 Codec codec = Codec::zstd);

/// Adds a rectangle of n x m surfels from a corner and two edges; the normal is edge_u x edge_v.
void add_rectangle(std::vector<Surfel>& surfels, const glm::dvec3& corner, const glm::dvec3& edge_u,
                   const glm::dvec3& edge_v, double spacing, const glm::vec3& radiance);

/// Adds a sphere of about 4 pi r^2 / spacing^2 surfels with normals outwards.
void add_sphere(std::vector<Surfel>& surfels, const glm::dvec3& centre, double radius,
                double spacing, const glm::vec3& radiance);

/// Returns a floor of z = 0 with a red wall and some balls: contacts, occlusion, colour.
[[nodiscard]] std::vector<Surfel> small_scene(double spacing);

/// Returns `count` random surfels in the unit cube with random normals and radii, the same ones for
/// the same seed.
[[nodiscard]] std::vector<Surfel> random_surfels(std::size_t count, std::uint64_t seed);

}  // namespace ptc::bench
