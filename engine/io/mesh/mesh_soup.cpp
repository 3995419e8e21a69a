// From polygons to a mesh: checks, triangles, and one index for all attributes of a vertex.
//
// Files index positions, normals and texture coordinates separately; a Mesh has one index per
// vertex. So each different combination of the three that occurs becomes a vertex:
//
//   corners of the triangles     1/1/1  2/1/1  3/2/1 | 3/2/1  2/1/1  4/1/1
//   vertices                       0      1      2       2      1      3
//
// Vertices are numbered in the order in which the triangles first use them, so the mesh does not
// depend on how equal corners are found.
#include "engine/io/mesh/mesh_soup.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/soup_rules.h"
#include "engine/io/mesh/spilled_mesh.h"

namespace ptc {
namespace {

using Corner = MeshSoup::Corner;
using Triangle = std::array<Corner, 3>;

constexpr std::uint32_t kNone = MeshSoup::kNone;

// The triangles of a soup, each with the material of its polygon.
struct Soup {
  std::vector<Triangle> triangles;
  std::vector<std::uint16_t> material_of;
  std::vector<ObjectRun> object_runs;
};

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& rule) {
  throw DataError(path.string() + ": " + rule);
}

void check_corners(MeshSoup& soup) {
  std::size_t corner = 0;
  for (std::size_t i = 0; i < soup.polygons.size(); ++i) {
    for (const std::size_t end = corner + soup.polygons.items()[i].corners; corner < end; ++corner)
      soup.corners.items()[corner] = soup.checked(soup.corners.items()[corner], i);
  }
}

// Checks all positions and returns the centre of their box, rounded to integers.
glm::dvec3 checked_origin(const MeshSoup& soup) {
  PositionCheck check(soup.path());
  for (const glm::dvec3& p : soup.positions.items()) check.add(p);
  return check.origin();
}

// Triangulates all polygons and drops triangles that have no area once their positions are float.
Soup make_triangles(const MeshSoup& soup, const std::vector<glm::vec3>& positions) {
  Soup made;
  made.triangles.reserve(soup.polygons.size());
  made.material_of.reserve(soup.polygons.size());
  std::vector<glm::dvec3> polygon;
  std::vector<std::array<std::uint32_t, 3>> cut;
  std::size_t first = 0, number = 0;
  auto run = soup.object_runs().begin();
  const auto drop_empty_run = [&] {
    if (!made.object_runs.empty() && made.object_runs.back().first == made.triangles.size())
      made.object_runs.pop_back();
  };
  for (const MeshSoup::Polygon& of : soup.polygons.items()) {
    if (run != soup.object_runs().end() && run->first == number) {
      drop_empty_run();
      made.object_runs.push_back(
          {static_cast<std::uint32_t>(made.triangles.size()), run++->object});
    }
    ++number;
    const auto corners = std::span(soup.corners.items()).subspan(first, of.corners);
    first += of.corners;
    polygon.clear();
    for (const Corner& corner : corners) polygon.push_back(soup.positions.items()[corner.position]);
    cut.clear();
    triangulate(polygon, cut);
    for (const auto& [a, b, c] : cut) {
      if (!has_area(positions[corners[a].position], positions[corners[b].position],
                    positions[corners[c].position]))
        continue;
      made.triangles.push_back({corners[a], corners[b], corners[c]});
      made.material_of.push_back(of.material);
    }
  }
  drop_empty_run();
  return made;
}

// Gives a flat normal to every corner that has none, unless no corner has one: then all normals are
// removed.
void complete_normals(MeshSoup& soup, std::vector<Triangle>& triangles,
                      const std::vector<glm::vec3>& positions) {
  std::vector<glm::vec3>& normals = soup.normals.items();
  for (glm::vec3& normal : normals) normal = unit_or_missing(normal);
  const auto missing = [&](const Corner& corner) {
    return corner.normal == kNone || normals[corner.normal] == glm::vec3(0);
  };
  const bool any = std::ranges::any_of(
      triangles, [&](const Triangle& triangle) { return !std::ranges::all_of(triangle, missing); });
  for (Triangle& triangle : triangles) {
    if (!any) {
      for (Corner& corner : triangle) corner.normal = kNone;
    } else if (std::ranges::any_of(triangle, missing)) {
      const auto index = static_cast<std::uint32_t>(normals.size());
      for (Corner& corner : triangle) {
        if (missing(corner)) corner.normal = index;
      }
      normals.push_back(flat_normal(positions[triangle[0].position],
                                    positions[triangle[1].position],
                                    positions[triangle[2].position]));
    }
  }
  if (!any) normals.clear();
}

// Gives the texture coordinates (0, 0) to every corner that has none, unless no corner has any:
// then all are removed.
void complete_uvs(MeshSoup& soup, std::vector<Triangle>& triangles) {
  for (glm::vec2& uv : soup.uvs.items()) uv = finite_or_zero(uv);
  const bool any = std::ranges::any_of(triangles, [](const Triangle& triangle) {
    return std::ranges::any_of(triangle, [](const Corner& c) { return c.uv != kNone; });
  });
  if (!any) {
    soup.uvs.clear();
    return;
  }
  const auto zero = static_cast<std::uint32_t>(soup.uvs.size());
  soup.uvs.push_back(glm::vec2(0));
  for (Triangle& triangle : triangles) {
    for (Corner& corner : triangle) {
      if (corner.uv == kNone) corner.uv = zero;
    }
  }
}

// Returns for each corner (three per triangle) the number of the first corner that equals it. It
// sorts them, so that the work does not depend on how many corners share a position.
std::vector<std::uint32_t> first_equals(const std::vector<Triangle>& triangles) {
  const auto corner = [&](std::uint32_t i) -> const Corner& { return triangles[i / 3][i % 3]; };
  const auto key = [&](std::uint32_t i) {
    const Corner& c = corner(i);
    return std::tuple(c.position, c.normal, c.uv);
  };
  std::vector<std::uint32_t> order(triangles.size() * 3);
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple_cat(key(a), std::tuple(a)) < std::tuple_cat(key(b), std::tuple(b));
  });
  std::vector<std::uint32_t> first(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && key(order[i]) == key(order[i - 1]);
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  return first;
}

// Returns what first_equals() does without a sort, for meshes with one index for all attributes.
std::vector<std::uint32_t> first_equals_by_position(const std::vector<Triangle>& triangles,
                                                    std::size_t positions) {
  std::vector<std::uint32_t> first_of(positions, kNone);
  std::vector<std::uint32_t> first(triangles.size() * 3);
  for (std::uint32_t i = 0; i < first.size(); ++i) {
    std::uint32_t& of = first_of[triangles[i / 3][i % 3].position];
    if (of == kNone) of = i;
    first[i] = of;
  }
  return first;
}

// Says whether every corner uses its position's index for its normal and texture coordinates, too.
bool one_index(const std::vector<Triangle>& triangles) {
  return std::ranges::all_of(triangles, [](const Triangle& triangle) {
    return std::ranges::all_of(triangle, [](const Corner& c) {
      return (c.normal == kNone || c.normal == c.position) && (c.uv == kNone || c.uv == c.position);
    });
  });
}

// Makes one vertex for each different corner, numbered in the order of the triangles.
void share_vertices(const MeshSoup& soup, const std::vector<Triangle>& triangles,
                    const std::vector<glm::vec3>& positions, Mesh& mesh) {
  const std::vector<std::uint32_t> first =
      one_index(triangles) ? first_equals_by_position(triangles, positions.size())
                           : first_equals(triangles);
  std::vector<std::uint32_t> vertex_of(first.size());
  mesh.triangles.resize(triangles.size());
  for (std::uint32_t i = 0; i < first.size(); ++i) {
    if (first[i] == i) {
      const Corner& corner = triangles[i / 3][i % 3];
      vertex_of[i] = static_cast<std::uint32_t>(mesh.positions.size());
      mesh.positions.push_back(positions[corner.position]);
      if (!soup.normals.empty()) mesh.normals.push_back(soup.normals.items()[corner.normal]);
      if (!soup.uvs.empty()) mesh.uvs.push_back(soup.uvs.items()[corner.uv]);
      if (!soup.colours.empty()) mesh.colours.push_back(soup.colours.items()[corner.position]);
    }
    mesh.triangles[i / 3][i % 3] = vertex_of[first[i]];
  }
}

}  // namespace

MeshSoup::Corner MeshSoup::checked(Corner corner, std::uint64_t polygon) const {
  const auto within = [](std::uint32_t index, std::uint64_t size) {
    return index == kNone || index < size;
  };
  if (uvs_dropped_) corner.uv = kNone;
  if (corner.position >= positions.size() || !within(corner.normal, normals.size()) ||
      !within(corner.uv, uvs.size()))
    refuse(path_, "polygon " + std::to_string(polygon) + ": an index refers to no vertex");
  return corner;
}

void MeshSoup::add_colour(std::uint64_t position, const glm::vec3& colour) {
  colours.grow(position, glm::vec3(1));
  const auto inside = [](float v) { return v > 0 ? std::min(v, 1.0F) : 0.0F; };  // NaN becomes 0
  colours.push_back({inside(colour.x), inside(colour.y), inside(colour.z)});
  if (colours.size() % kItemsBetweenChecks == 0) check_room();
}

std::size_t MeshSoup::add_material(Material material) {
  if (materials.size() == kMaxMaterials) refuse(path_, "the file has more than 65,536 materials");
  materials.push_back(std::move(material));
  return materials.size() - 1;
}

std::uint32_t MeshSoup::begin_object(const std::string& name) {
  constexpr std::size_t kMaxObjects = 65536, kMaxName = 255;
  if (spilled() || too_many_objects_) return 0;
  if (objects_.size() == kMaxObjects) {
    too_many_objects_ = true;
    forget_objects();
    return 0;
  }
  objects_.push_back(name.substr(0, kMaxName));
  object_bytes_ += sizeof(std::string) + objects_.back().capacity();
  const auto object = static_cast<std::uint32_t>(objects_.size() - 1);
  resume_object(object);
  return object;
}

void MeshSoup::resume_object(std::uint32_t object) {
  if (objects_.empty()) return;
  // What comes before all objects is one without a name
  if (runs_.empty() && !polygons.empty()) {
    objects_.emplace_back();
    object_bytes_ += sizeof(std::string);
    runs_.push_back({0, static_cast<std::uint32_t>(objects_.size() - 1)});
  }
  if (!runs_.empty() && runs_.back().first == polygons.size()) runs_.pop_back();
  runs_.push_back({polygons.size(), object});
}

void MeshSoup::forget_objects() {
  objects_ = {};
  runs_ = {};
  object_bytes_ = 0;
}

void MeshSoup::add_polygon(std::span<const Corner> polygon, std::size_t material) {
  corners.append(polygon);
  triangles_ += std::max<std::size_t>(polygon.size(), 2) - 2;
  polygons.push_back(
      {static_cast<std::uint32_t>(polygon.size()), static_cast<std::uint16_t>(material)});
  if (polygons.size() % kItemsBetweenChecks == 0) check_room();
}

void MeshSoup::drop_uvs() {
  uvs.clear();
  uvs_dropped_ = true;
}

std::uint64_t MeshSoup::peak_bytes() const noexcept {
  // The bytes of an item of each list, and of what build_mesh() makes of it before it is freed
  return 12 * corners.size() + 94 * triangles_ + 8 * polygons.size() + 56 * positions.size() +
         40 * normals.size() + 24 * uvs.size() + 24 * colours.size() +
         (sizeof(Run) + sizeof(ObjectRun)) * runs_.size() + 2 * object_bytes_;
}

void MeshSoup::check_room() {
  constexpr std::uint64_t kMaxTriangles = 0xffffffffU / 3;  // whose corners build_mesh() can number
  if (spilled() || (peak_bytes() <= room_.memory_bytes && triangles_ <= kMaxTriangles)) return;
  positions.spill(room_.temp_directory);
  normals.spill(room_.temp_directory);
  uvs.spill(room_.temp_directory);
  colours.spill(room_.temp_directory);
  corners.spill(room_.temp_directory);
  polygons.spill(room_.temp_directory);
  forget_objects();
}

void MeshSoup::settle() {
  if (!colours.empty()) colours.grow(positions.size(), glm::vec3(1));
  if (materials.empty()) materials.emplace_back();
  for (Material& material : materials) {
    if (room_.material) {
      Material other = *room_.material;
      if (other.name.empty()) other.name = std::move(material.name);
      other.double_sided = material.double_sided;
      other.opacity = material.opacity;
      other.opacity_texture = std::move(material.opacity_texture);
      other.opacity_cutoff = material.opacity_cutoff;
      if (other.opacity_texture) other.wrap = material.wrap;
      material = std::move(other);
    }
    material.double_sided |= !room_.one_sided;
  }
  check_room();
  if (!spilled()) return;
  positions.end();
  normals.end();
  uvs.end();
  colours.end();
  corners.end();
  polygons.end();
}

Mesh build_mesh(MeshSoup soup) {
  check_corners(soup);
  Mesh mesh;
  mesh.origin = checked_origin(soup);
  std::vector<glm::vec3> positions;
  positions.reserve(soup.positions.size());
  for (const glm::dvec3& position : soup.positions.items())
    positions.emplace_back(position - mesh.origin);
  Soup made = make_triangles(soup, positions);
  complete_normals(soup, made.triangles, positions);
  complete_uvs(soup, made.triangles);
  share_vertices(soup, made.triangles, positions, mesh);
  mesh.material_of = std::move(made.material_of);
  mesh.materials = std::move(soup.materials);
  if (!mesh.triangles.empty() && !made.object_runs.empty()) {
    mesh.objects = soup.objects();
    mesh.object_runs = std::move(made.object_runs);
  }
  return mesh;
}

MeshFile mesh_file(MeshSoup soup, std::vector<MeshCamera> cameras,
                   std::vector<std::string> warnings, bool may_be_empty) {
  const std::filesystem::path path = soup.path();
  soup.settle();
  MeshFile file{.cameras = std::move(cameras), .warnings = std::move(warnings)};
  if (soup.spilled()) {
    file.spilled = std::make_shared<const SpilledMesh>(std::move(soup));
  } else {
    file.mesh = build_mesh(std::move(soup));
  }
  if (file.spilled ? file.spilled->triangles() == 0 : file.mesh.triangles.empty()) {
    if (!may_be_empty) refuse(path, "the mesh has no triangle");
    file.spilled.reset();
    file.mesh = {};
  }
  return file;
}

}  // namespace ptc
