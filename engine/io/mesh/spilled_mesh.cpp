// Triangles are made anew in each pass from the polygons and vertices of the soup:
//
//   polygons, corners    read from front to back
//   positions, normals,  read through a cache, because polygons that follow one another are mostly
//   uvs, colours         neighbours
//
// The first pass over the triangles checks indices and finds what all triangles have in common.
#include "engine/io/mesh/spilled_mesh.h"

#include <algorithm>
#include <string>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/mesh/mesh_soup.h"
#include "engine/io/mesh/soup_rules.h"

namespace ptc {
namespace {

using Corner = MeshSoup::Corner;
constexpr std::size_t kBlock = 1 << 12;  // triangles handed on at once

/// Makes the triangles of a soup, in its order.
class TriangleReader {
 public:
  TriangleReader(const MeshSoup& soup, const glm::dvec3& origin)
      : soup_(soup),
        origin_(origin),
        polygons_(soup.polygons, 1 << 14),
        corners_(soup.corners, 1 << 14),
        positions_(soup.positions, 4 << 20),
        normals_(soup.normals, 2 << 20),
        uvs_(soup.uvs, 1 << 20),
        colours_(soup.colours, 1 << 18) {}

  /// Calls take(triangle, normals, uvs) for each triangle with an area. `normals` and `uvs` say
  /// whether a corner has such a value; corners that lack a normal have that of the plane.
  template <typename Take>
  void read(const Take& take) {
    std::uint64_t first = 0;
    for (std::uint64_t i = 0; i < soup_.polygons.size(); ++i) {
      const MeshSoup::Polygon of = polygons_[i];
      load(i, first, of.corners);
      first += of.corners;
      cut_.clear();
      triangulate(world_, cut_);
      for (const auto& cut : cut_) {
        MeshTriangle triangle{.material = of.material};
        for (std::size_t k = 0; k < 3; ++k)
          triangle.positions[k] = glm::vec3(world_[cut[k]] - origin_);
        const auto& [a, b, c] = triangle.positions;
        if (!has_area(a, b, c)) continue;
        const bool normals = find_normals(cut, triangle), uvs = find_uvs(cut, triangle);
        if (!soup_.colours.empty()) {
          for (std::size_t k = 0; k < 3; ++k)
            triangle.colours[k] = colours_[of_polygon_[cut[k]].position];
        }
        take(triangle, normals, uvs);
      }
    }
  }

 private:
  /// Reads the corners of a polygon and their positions.
  void load(std::uint64_t polygon, std::uint64_t first, std::uint32_t count) {
    of_polygon_.clear();
    world_.clear();
    for (std::uint64_t i = first; i < first + count; ++i) {
      const Corner corner = soup_.checked(corners_[i], polygon);
      of_polygon_.push_back(corner);
      world_.push_back(positions_[corner.position]);
    }
  }

  bool find_normals(const std::array<std::uint32_t, 3>& cut, MeshTriangle& triangle) {
    bool any = false, all = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t at = of_polygon_[cut[k]].normal;
      if (at != MeshSoup::kNone) triangle.normals[k] = unit_or_missing(normals_[at]);
      const bool has = triangle.normals[k] != glm::vec3(0);
      any |= has;
      all &= has;
    }
    if (all) return true;
    const auto& [a, b, c] = triangle.positions;
    const glm::vec3 flat = flat_normal(a, b, c);
    for (glm::vec3& normal : triangle.normals) {
      if (normal == glm::vec3(0)) normal = flat;
    }
    return any;
  }

  bool find_uvs(const std::array<std::uint32_t, 3>& cut, MeshTriangle& triangle) {
    bool any = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t at = of_polygon_[cut[k]].uv;
      if (at == MeshSoup::kNone) continue;
      any = true;
      triangle.uvs[k] = finite_or_zero(uvs_[at]);
    }
    return any;
  }

  const MeshSoup& soup_;
  glm::dvec3 origin_;
  SpoolReader<MeshSoup::Polygon> polygons_;
  SpoolReader<Corner> corners_;
  SpoolReader<glm::dvec3> positions_;
  SpoolReader<glm::vec3> normals_;
  SpoolReader<glm::vec2> uvs_;
  SpoolReader<glm::vec3> colours_;
  std::vector<Corner> of_polygon_;  ///< corners of one polygon
  std::vector<glm::dvec3> world_;   ///< their positions
  std::vector<std::array<std::uint32_t, 3>> cut_;
};

}  // namespace

SpilledMesh::SpilledMesh(MeshSoup soup) : soup_(std::make_unique<MeshSoup>(std::move(soup))) {
  // Check the positions
  PositionCheck check(soup_->path());
  {
    SpoolReader<glm::dvec3> positions(soup_->positions, 1 << 14);
    for (std::uint64_t i = 0; i < soup_->positions.size(); ++i) check.add(positions[i]);
  }
  origin_ = check.origin();
  // Measure the triangles
  TriangleReader(*soup_, origin_).read([&](const MeshTriangle& triangle, bool normals, bool uvs) {
    ++triangles_;
    has_normals_ |= normals;
    has_uvs_ |= uvs;
    for (const glm::vec3& position : triangle.positions)
      bounds_.add(origin_ + glm::dvec3(position));
  });
}

SpilledMesh::~SpilledMesh() = default;

const std::vector<Material>& SpilledMesh::materials() const noexcept {
  return soup_->materials;
}

bool SpilledMesh::has_colours() const noexcept {
  return !soup_->colours.empty();
}

void SpilledMesh::visit(const Visit& visit) const {
  std::vector<MeshTriangle> block;
  block.reserve(kBlock);
  TriangleReader(*soup_, origin_).read([&](MeshTriangle triangle, bool, bool) {
    if (!has_normals_) triangle.normals = {};
    if (!has_uvs_) triangle.uvs = {};
    block.push_back(triangle);
    if (block.size() < kBlock) return;
    visit(block);
    block.clear();
  });
  visit(block);
}

}  // namespace ptc
