// The city as a stream of surfels, and as a mesh.
//
// The stream and the mesh come from the facets of build_block(), one block at a time, so the size
// of the city takes memory only as a mesh. Points lie in rows along u, each in the middle of its
// cell but for a jitter of a quarter cell:
//
//       v                                  v
//       ^  +-----+-----+-----+             ^  +
//       |  |  .  |.    |   . |   row 1     |  | .\          The rows of a triangle shorten
//       |  +-----+-----+-----+             |  |---\         with height, so that every cell
//       |  | .   |   . |  .  |   row 0     |  | .| .\       has about the same area.
//       |  +-----+-----+-----+             |  +------+
//       +-----------------------> u        +-----------> u
//
// A facet too small for two points owes its share to the next such facet (`carry`), so that the
// many small leaves of trees get their points in the mean.
#include "engine/scene/procedural/city.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/base/low_discrepancy.h"
#include "engine/scene/procedural/city_block.h"
#include "engine/scene/sampling/directions.h"

namespace ptc {
namespace {

constexpr double kSpacing = 0.25;               // metres between neighbouring points
constexpr std::uint64_t kCountedBlocks = 1024;  // blocks whose points are counted one by one; their
                                                // mean stands for further blocks

// The layout of the points on one facet: rows along u, each with as many points as it is long.
class FacetRows {
 public:
  // @param carry  points that small facets before this one still owe; is updated
  FacetRows(const Facet& facet, float spacing, float& carry)
      : taper_(facet.is_triangle ? 1.0f : 0.0f) {
    const float length = glm::length(facet.u);
    const float twice = glm::length(glm::cross(facet.u, facet.v));
    area_ = facet.is_triangle ? 0.5f * twice : twice;
    const float wanted = area_ / (spacing * spacing);
    // Give a small facet the whole points among what is owed by now, in one row.
    if (wanted < 2) {
      carry += wanted;
      rows_ = carry >= 1 ? 1 : 0;
      across_ = std::floor(carry);
      carry -= across_;
      taper_ = 0;
      count_ = static_cast<std::uint32_t>(across_);
      shrink_ = facet.is_triangle ? 0.5f : 1.0f;
      each_ = spacing * spacing;
      return;
    }
    // Lay rows one spacing apart over the height of the facet.
    rows_ = static_cast<std::uint32_t>(std::max(1.0f, std::round(twice / length / spacing)));
    across_ = std::max(1.0f, length / spacing);
    for (std::uint32_t row = 0; row < rows_; ++row) count_ += in_row(row);
    each_ = area_ / static_cast<float>(count_);
  }

  [[nodiscard]] std::uint32_t count() const { return count_; }
  [[nodiscard]] std::uint32_t rows() const { return rows_; }
  [[nodiscard]] float area_each() const { return each_; }

  [[nodiscard]] std::uint32_t in_row(std::uint32_t row) const {
    return static_cast<std::uint32_t>(
        std::max(1.0f, std::round(across_ * width(height(row, 0.5f)))));
  }
  // Returns the share of v at a place in a row. @param within  place across the row, in [0, 1]
  [[nodiscard]] float height(std::uint32_t row, float within) const {
    return (static_cast<float>(row) + within) / static_cast<float>(rows_) * shrink_;
  }
  // Returns the share of u that the facet is wide at a height.
  [[nodiscard]] float width(float height) const { return shrink_ * (1 - taper_ * height); }

 private:
  float taper_;       // 1 in a triangle, whose rows shorten to nothing; 0 in a parallelogram
  float shrink_ = 1;  // 0.5 in a small triangle: its points lie in the parallelogram at its corner
  float area_ = 0;
  float across_ = 0;  // points in a row of full length
  float each_ = 0;    // area for each point
  std::uint32_t rows_ = 0;
  std::uint32_t count_ = 0;
};

// Counts the points of a block without making them.
std::uint64_t count_block(std::uint64_t index, float spacing) {
  std::uint64_t count = 0;
  float carry = 0.5f;
  for (const Facet& facet : build_block(block_place(index))) {
    count += FacetRows(facet, spacing, carry).count();
  }
  return count;
}

struct Layout {
  std::uint64_t blocks = 0;
  double spacing = kSpacing;
};

std::uint64_t count_blocks(const Layout& layout) {
  std::uint64_t count = 0;
  for (std::uint64_t i = 0; i < layout.blocks; ++i) {
    count += count_block(i, static_cast<float>(layout.spacing));
  }
  return count;
}

// Takes as many blocks as give the count at the usual spacing; where the last block brings far too
// many points, a slightly wider spacing.
Layout find_layout(std::uint64_t count) {
  // Count blocks until they have enough points.
  Layout layout;
  std::uint64_t have = 0;
  while (have < count && layout.blocks < kCountedBlocks) {
    have += count_block(layout.blocks++, static_cast<float>(kSpacing));
  }
  // Extrapolate a large city from the mean of its first blocks.
  if (have < count) {
    const double mean = static_cast<double>(have) / static_cast<double>(layout.blocks);
    layout.blocks = static_cast<std::uint64_t>(std::ceil(static_cast<double>(count) / mean));
    return layout;
  }
  // Widen the spacing of a small city until its count is met within 1.5 %.
  for (int round = 0; round < 12; ++round) {
    const double excess = static_cast<double>(have) / static_cast<double>(count);
    if (count == 0 || std::abs(excess - 1) < 0.015) break;
    layout.spacing *= std::sqrt(std::clamp(excess, 0.25, 4.0));
    have = count_blocks(layout);
  }
  return layout;
}

// Keeps the last layout: to count the blocks of a large city takes tens of milliseconds, and a task
// of a farm asks for their number before it makes some of them.
Layout lay_out(std::uint64_t count) {
  static std::mutex mutex;
  static std::optional<std::pair<std::uint64_t, Layout>> last;
  const std::lock_guard lock(mutex);
  if (!last || last->first != count) last = {count, find_layout(count)};
  return last->second;
}

constexpr glm::vec3 kToSun(0.45f, 0.84f, 0.3f);
constexpr glm::vec3 kSunIrradiance(3.0f, 2.8f, 2.4f);
constexpr glm::vec3 kSkyIrradiance(0.7f, 0.85f, 1.1f);  // on a facet that looks up

// Returns the radiance that sun and sky reflect off a facet, without shadows: how much of the sky
// the facet sees depends on its tilt alone.
glm::vec3 radiance_of(const glm::vec3& albedo, const glm::vec3& normal) {
  const glm::vec3 to_sun = glm::normalize(kToSun);
  const glm::vec3 sun = kSunIrradiance * std::max(0.0f, glm::dot(normal, to_sun));
  const glm::vec3 sky = kSkyIrradiance * (0.5f + 0.5f * normal.y);
  return albedo / kPi * (sun + sky);
}

// Appends the surfels of a facet.
// @param block  the low corner of its block, metres
void sample_facet(const Facet& facet, const FacetRows& rows, const glm::dvec3& block,
                  std::uint64_t seed, std::vector<Surfel>& out) {
  // Set what all surfels of the facet share. A surfel stands for 2 r^2 of surface.
  Surfel surfel;
  surfel.normal = glm::normalize(glm::cross(facet.u, facet.v));
  surfel.radius = std::sqrt(0.5f * rows.area_each());
  surfel.albedo = city_albedo(facet.colour);
  surfel.radiance = radiance_of(surfel.albedo, surfel.normal);
  const glm::dvec3 corner = block + glm::dvec3(facet.corner);
  // Place a point in each cell, off its middle by up to a quarter of the cell.
  const auto jitter = [](std::uint32_t bits) { return 0.25f + 0.5f * to_unit(bits); };
  for (std::uint32_t row = 0; row < rows.rows(); ++row) {
    const std::uint32_t count = row == 0 && rows.rows() == 1 ? rows.count() : rows.in_row(row);
    for (std::uint32_t i = 0; i < count; ++i) {
      seed = splitmix64(seed);
      const float b = rows.height(row, jitter(static_cast<std::uint32_t>(seed)));
      const float a = (static_cast<float>(i) + jitter(static_cast<std::uint32_t>(seed >> 32))) /
                      static_cast<float>(count) * rows.width(b);
      surfel.position = corner + glm::dvec3(a * facet.u + b * facet.v);
      out.push_back(surfel);
    }
  }
}

// Streams the surfels of the blocks, of which it holds one at a time.
class CitySource final : public PointSource {
 public:
  CitySource(const Layout& layout, const CityBlocks& blocks)
      : layout_(layout), blocks_(blocks), block_(blocks.first) {}

  std::size_t next(std::span<Surfel> out) override {
    std::size_t filled = 0;
    while (filled < out.size()) {
      if (taken_ == points_.size() && !fetch()) break;
      const std::size_t count = std::min(out.size() - filled, points_.size() - taken_);
      std::copy_n(points_.begin() + static_cast<std::ptrdiff_t>(taken_), count,
                  out.begin() + static_cast<std::ptrdiff_t>(filled));
      filled += count;
      taken_ += count;
    }
    return filled;
  }

 private:
  // Makes the points of the next block that has any. @return  false after the last block
  bool fetch() {
    points_.clear();
    taken_ = 0;
    while (points_.empty() && block_ < blocks_.end) {
      const BlockPlace place = block_place(block_);
      const glm::dvec3 corner = block_corner(place);
      float carry = 0.5f;
      std::uint64_t seed = splitmix64(block_);
      for (const Facet& facet : build_block(place)) {
        const FacetRows rows(facet, static_cast<float>(layout_.spacing), carry);
        sample_facet(facet, rows, corner, ++seed, points_);
      }
      block_ += blocks_.step;
    }
    return !points_.empty();
  }

  Layout layout_;
  CityBlocks blocks_;
  std::uint64_t block_;         // the next one
  std::vector<Surfel> points_;  // of the current block
  std::size_t taken_ = 0;       // points of it that were handed out
};

// Appends a facet to a mesh as one or two triangles.
void add_facet(const Facet& facet, const glm::dvec3& block, Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const auto put = [&](const glm::vec3& p) { mesh.positions.emplace_back(block + glm::dvec3(p)); };
  put(facet.corner);
  put(facet.corner + facet.u);
  if (!facet.is_triangle) put(facet.corner + facet.u + facet.v);
  put(facet.corner + facet.v);
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.material_of.push_back(facet.colour);
  if (facet.is_triangle) return;
  mesh.triangles.push_back({first, first + 2, first + 3});
  mesh.material_of.push_back(facet.colour);
}

}  // namespace

std::unique_ptr<PointSource> make_city(std::uint64_t count) {
  const Layout layout = lay_out(count);
  return std::make_unique<CitySource>(layout, CityBlocks{.end = layout.blocks});
}

std::unique_ptr<PointSource> make_city(std::uint64_t count, const CityBlocks& blocks) {
  return std::make_unique<CitySource>(lay_out(count), blocks);
}

std::uint64_t city_blocks(std::uint64_t count) {
  return lay_out(count).blocks;
}

LightRig city_lights() {
  LightRig rig;
  rig.suns = {{.to_sun = glm::normalize(kToSun), .irradiance = kSunIrradiance}};
  rig.sky.radiance = kSkyIrradiance / kPi;
  return rig;
}

Bounds city_bounds(std::uint64_t count) {
  const Layout layout = lay_out(count);
  Bounds bounds;
  if (layout.blocks == 0) return bounds;
  // The last block lies on the widest ring of the spiral, and ledges stay within their block.
  const BlockPlace last = block_place(layout.blocks - 1);
  const auto ring = static_cast<double>(std::max(std::abs(last.column), std::abs(last.row)));
  const double reach = (ring + 0.5) * kBlockMetres;
  bounds.add(glm::dvec3(-reach, kCityLow, -reach));
  bounds.add(glm::dvec3(reach, kCityHigh, reach));
  return bounds;
}

Mesh city_mesh(std::uint64_t count) {
  // Refuse a city whose ground alone has too many vertices.
  const Layout layout = lay_out(count);
  constexpr std::uint64_t kMax = 0xFFFFFFFF;
  const auto require = [](bool fits) {
    if (!fits)
      throw RequestError("city_points",
                         "as a mesh, a city of this size has 2^32 vertices or more: ask for fewer "
                         "`city_points`");
  };
  require(layout.blocks < kMax / 3 / kGroundTriangles);
  // Make a material of each colour.
  Mesh mesh;
  for (std::uint32_t colour = 0; colour < kCityColours; ++colour) {
    Material material;
    material.name = "city" + std::to_string(colour);
    material.albedo = city_albedo(colour);
    mesh.materials.push_back(material);
  }
  // Add the blocks.
  for (std::uint64_t i = 0; i < layout.blocks; ++i) {
    const BlockPlace place = block_place(i);
    const std::vector<Facet> facets = build_block(place);
    require(mesh.positions.size() + 4 * facets.size() <= kMax);
    for (const Facet& facet : facets) add_facet(facet, block_corner(place), mesh);
  }
  return mesh;
}

}  // namespace ptc
