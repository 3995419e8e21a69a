// The city as a stream of surfels, and as a mesh.
#include "engine/scene/procedural/city.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/scene/procedural/city_block.h"
#include "engine/scene/sampling/directions.h"
#include "engine/scene/sampling/low_discrepancy.h"

namespace ptc {
namespace {

constexpr double kSpacing = 0.25;               // metres
constexpr std::uint64_t kCountedBlocks = 1024;  // beyond, their mean stands for the rest

// How points lie on a facet: rows along u, of as many points as the row is long.
class FacetRows {
 public:
  // @param carry  points owed by facets too small for a whole one; taken from and added to
  FacetRows(const Facet& facet, float spacing, float& carry)
      : taper_(facet.is_triangle ? 1.0f : 0.0f) {
    const float length = glm::length(facet.u);
    const float twice = glm::length(glm::cross(facet.u, facet.v));
    area_ = facet.is_triangle ? 0.5f * twice : twice;
    const float wanted = area_ / (spacing * spacing);
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
  // Share of v at a place in a row, and what share of u the facet is wide there.
  [[nodiscard]] float height(std::uint32_t row, float within) const {
    return (static_cast<float>(row) + within) / static_cast<float>(rows_) * shrink_;
  }
  [[nodiscard]] float width(float height) const { return shrink_ * (1 - taper_ * height); }

 private:
  float taper_;       // 1: the rows of a triangle shorten to nothing
  float shrink_ = 1;  // a small triangle's points lie in the parallelogram at its corner
  float area_ = 0;
  float across_ = 0;  // points in a row of full length
  float each_ = 0;    // area for each
  std::uint32_t rows_ = 0;
  std::uint32_t count_ = 0;
};

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

// As many blocks as give the count at the usual spacing; when the last is much too many, a spacing
// that is a little wider.
Layout lay_out(std::uint64_t count) {
  Layout layout;
  std::uint64_t have = 0;
  while (have < count && layout.blocks < kCountedBlocks) {
    have += count_block(layout.blocks++, static_cast<float>(kSpacing));
  }
  if (have < count) {
    const double mean = static_cast<double>(have) / static_cast<double>(layout.blocks);
    layout.blocks = static_cast<std::uint64_t>(std::ceil(static_cast<double>(count) / mean));
    return layout;
  }
  for (int round = 0; round < 12; ++round) {
    const double excess = static_cast<double>(have) / static_cast<double>(count);
    if (count == 0 || std::abs(excess - 1) < 0.015) break;
    layout.spacing *= std::sqrt(std::clamp(excess, 0.25, 4.0));
    have = count_blocks(layout);
  }
  return layout;
}

constexpr glm::vec3 kToSun(0.45f, 0.84f, 0.3f);
constexpr glm::vec3 kSunIrradiance(3.0f, 2.8f, 2.4f);
constexpr glm::vec3 kSkyIrradiance(0.7f, 0.85f, 1.1f);  // of a facet that looks up

// Sun and sky without shadows: what the sky shows of a facet depends on its tilt alone.
glm::vec3 radiance_of(const glm::vec3& albedo, const glm::vec3& normal) {
  const glm::vec3 to_sun = glm::normalize(kToSun);
  const glm::vec3 sun = kSunIrradiance * std::max(0.0f, glm::dot(normal, to_sun));
  const glm::vec3 sky = kSkyIrradiance * (0.5f + 0.5f * normal.y);
  return albedo / kPi * (sun + sky);
}

void sample_facet(const Facet& facet, const FacetRows& rows, const glm::dvec3& block,
                  std::uint64_t seed, std::vector<Surfel>& out) {
  Surfel surfel;
  surfel.normal = glm::normalize(glm::cross(facet.u, facet.v));
  surfel.radius = std::sqrt(0.5f * rows.area_each());
  surfel.albedo = city_albedo(facet.colour);
  surfel.radiance = radiance_of(surfel.albedo, surfel.normal);
  const glm::dvec3 corner = block + glm::dvec3(facet.corner);
  // Off the middle of the cell by up to a quarter of it.
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

class CitySource final : public PointSource {
 public:
  explicit CitySource(std::uint64_t count) : layout_(lay_out(count)) {}

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
  // The next block that has points.
  bool fetch() {
    points_.clear();
    taken_ = 0;
    while (points_.empty() && block_ < layout_.blocks) {
      const BlockPlace place = block_place(block_);
      const glm::dvec3 corner = block_corner(place);
      float carry = 0.5f;
      std::uint64_t seed = splitmix64(block_);
      for (const Facet& facet : build_block(place)) {
        const FacetRows rows(facet, static_cast<float>(layout_.spacing), carry);
        sample_facet(facet, rows, corner, ++seed, points_);
      }
      ++block_;
    }
    return !points_.empty();
  }

  Layout layout_;
  std::uint64_t block_ = 0;
  std::vector<Surfel> points_;  // of one block
  std::size_t taken_ = 0;
};

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
  return std::make_unique<CitySource>(count);
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
  // The last block lies on the widest ring. Ledges stay within their block.
  const BlockPlace last = block_place(layout.blocks - 1);
  const auto ring = static_cast<double>(std::max(std::abs(last.column), std::abs(last.row)));
  const double reach = (ring + 0.5) * kBlockMetres;
  bounds.add(glm::dvec3(-reach, kCityLow, -reach));
  bounds.add(glm::dvec3(reach, kCityHigh, reach));
  return bounds;
}

Mesh city_mesh(std::uint64_t count) {
  const Layout layout = lay_out(count);
  constexpr std::uint64_t kMax = 0xFFFFFFFF;
  const auto require = [](bool fits) {
    if (!fits)
      throw RequestError("city_points", "a mesh of so large a city has 2^32 vertices or more");
  };
  require(layout.blocks < kMax / 3 / kGroundTriangles);
  Mesh mesh;
  for (std::uint32_t colour = 0; colour < kCityColours; ++colour) {
    Material material;
    material.name = "city" + std::to_string(colour);
    material.albedo = city_albedo(colour);
    mesh.materials.push_back(material);
  }
  for (std::uint64_t i = 0; i < layout.blocks; ++i) {
    const BlockPlace place = block_place(i);
    const std::vector<Facet> facets = build_block(place);
    require(mesh.positions.size() + 4 * facets.size() <= kMax);
    for (const Facet& facet : facets) add_facet(facet, block_corner(place), mesh);
  }
  return mesh;
}

}  // namespace ptc
