// Meshes: the choice of a reader, the joining of two meshes, and a writer.
//
// Positions are floats relative to an origin in double, so a mesh keeps millimetres anywhere within
// ten million metres. To join two meshes, the world positions of the second are computed in double
// and stored relative to the origin of the first:
//
//   stored = float(transform * (origin_2 + position) - origin_1)
#include "engine/io/mesh/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/point_format.h"
#include "engine/io/file/buffered_output.h"
#include "engine/io/mesh/mesh_soup.h"
#include "engine/io/mesh/soup_rules.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

// Gives each triangle its own three vertices, with the normal of its plane.
void flatten(Mesh& mesh) {
  Mesh flat;
  for (auto& triangle : mesh.triangles) {
    const auto at = [&](std::size_t k) { return mesh.positions[triangle[k]]; };
    const glm::vec3 normal = flat_normal(at(0), at(1), at(2));
    for (std::uint32_t& vertex : triangle) {
      flat.positions.push_back(mesh.positions[vertex]);
      flat.normals.push_back(normal);
      if (!mesh.uvs.empty()) flat.uvs.push_back(mesh.uvs[vertex]);
      if (!mesh.colours.empty()) flat.colours.push_back(mesh.colours[vertex]);
      vertex = static_cast<std::uint32_t>(flat.positions.size() - 1);
    }
  }
  mesh.positions = std::move(flat.positions);
  mesh.normals = std::move(flat.normals);
  mesh.uvs = std::move(flat.uvs);
  mesh.colours = std::move(flat.colours);
}

// Adds normals, texture coordinates or colours to the mesh that lacks them, if the other one has
// them.
void level_attributes(Mesh& a, Mesh& b) {
  if (a.normals.empty() != b.normals.empty()) flatten(a.normals.empty() ? a : b);
  if (a.uvs.empty() != b.uvs.empty()) {
    Mesh& without = a.uvs.empty() ? a : b;
    without.uvs.assign(without.positions.size(), glm::vec2(0));
  }
  if (a.colours.empty() != b.colours.empty()) {
    Mesh& without = a.colours.empty() ? a : b;
    without.colours.assign(without.positions.size(), glm::vec3(1));
  }
}

glm::dvec3 rounded_centre(const Bounds& bounds) {
  return bounds.empty() ? glm::dvec3(0) : glm::round(bounds.low / 2.0 + bounds.high / 2.0);
}

// Replaces the positions of a mesh by their transformed world positions, relative to `origin`.
void transform_positions(Mesh& mesh, const glm::dmat4& transform, const glm::dvec3& origin) {
  for (glm::vec3& position : mesh.positions) {
    const glm::dvec3 world = mesh.origin + glm::dvec3(position);
    position = glm::vec3(glm::dvec3(transform * glm::dvec4(world, 1)) - origin);
  }
  mesh.origin = origin;
}

// Makes the triangles of a mesh that has no objects one.
void complete_objects(Mesh& mesh) {
  if (!mesh.objects.empty() || mesh.triangles.empty()) return;
  mesh.objects.emplace_back();
  mesh.object_runs.push_back({});
}

// Appends the objects of a mesh whose triangles are appended next.
void append_objects(Mesh& mesh, Mesh& added) {
  if (mesh.objects.empty() && added.objects.empty()) return;
  complete_objects(mesh);
  complete_objects(added);
  const auto triangle = static_cast<std::uint32_t>(mesh.triangles.size()),
             object = static_cast<std::uint32_t>(mesh.objects.size());
  for (const ObjectRun& run : added.object_runs)
    mesh.object_runs.push_back({triangle + run.first, object + run.object});
  std::ranges::move(added.objects, std::back_inserter(mesh.objects));
}

// Turns the normals, and reverses the triangles when the transform mirrors.
void transform_directions(Mesh& mesh, const glm::dmat4& transform) {
  const glm::dmat3 turn = normal_transform(transform);
  for (glm::vec3& normal : mesh.normals) {
    const glm::dvec3 turned = turn * glm::dvec3(normal);
    const double length = glm::length(turned);
    if (length > 0) normal = glm::vec3(turned / length);
  }
  if (!mirrors(transform)) return;
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

Bounds transformed_bounds(const Mesh& mesh, const glm::dmat4& transform) {
  Bounds bounds;
  for (const glm::vec3& position : mesh.positions) {
    bounds.add(glm::dvec3(transform * glm::dvec4(mesh.origin + glm::dvec3(position), 1)));
  }
  return bounds;
}

}  // namespace

Bounds Mesh::bounds() const {
  Bounds bounds;
  for (const glm::vec3& position : positions) bounds.add(origin + glm::dvec3(position));
  return bounds;
}

bool Mesh::emits() const {
  const auto emits = [](const Material& m) { return m.emission != glm::vec3(0); };
  if (std::ranges::none_of(materials, emits)) return false;
  return std::ranges::any_of(material_of, [&](std::size_t m) { return emits(materials[m]); });
}

bool Mesh::is_opaque() const {
  return std::ranges::all_of(materials, &Material::is_opaque);
}

std::uint64_t bytes_of(const Mesh& mesh) noexcept {
  constexpr std::uint64_t kTriangle = sizeof(mesh.triangles[0]) + sizeof(mesh.material_of[0]),
                          kVertex = 2 * sizeof(glm::vec3) + sizeof(glm::vec2);
  std::uint64_t objects = mesh.object_runs.size() * sizeof(ObjectRun);
  for (const std::string& name : mesh.objects) objects += sizeof(name) + name.capacity();
  return mesh.triangles.size() * kTriangle + mesh.positions.size() * kVertex +
         mesh.colours.size() * sizeof(glm::vec3) + objects;
}

MeshFile read_mesh(const std::filesystem::path& path, const MeshRoom& room) {
  const std::string extension = lower_extension(path);
  const std::string unpacked = extension == ".gz" ? lower_extension(path.stem()) : extension;
  if (unpacked == ".ply") return read_ply_mesh(path, room);
  if (unpacked == ".off") return read_off_mesh(path, room);
  if (unpacked == ".obj") return read_obj_mesh(path, room);
  if (extension == ".gltf" || extension == ".glb") return read_gltf_mesh(path, room);
  if (extension == ".stl") return read_stl_mesh(path, room);
  throw DataError(
      path.string() +
      ": nothing that can be read: as a mesh its name would end in .obj, .ply, .off, .gltf, "
      ".glb or .stl, and its content is that of no point cloud among PLY, LAS, LAZ, E57, "
      "PCD, PTX, PTS, XYZ text, Pixar's PTC, Houdini's classic BGEO and Maya's PDB" +
      hint_at_content(path));
}

CameraFile read_cameras(const std::filesystem::path& path, std::optional<double> seconds,
                        std::uint64_t memory_bytes) {
  const std::string extension = lower_extension(path);
  if (extension != ".gltf" && extension != ".glb") return {};
  return read_gltf_cameras(path, seconds, memory_bytes);
}

void append_mesh(Mesh& mesh, const Mesh& other, const glm::dmat4& transform, const char* field) {
  // Refuse what cannot be joined.
  if (!is_placement(Placement(transform))) {
    throw std::invalid_argument("append_mesh: the transform is not finite and invertible");
  }
  if (mesh.materials.size() + other.materials.size() > kMaxMaterials) {
    throw RequestError(field, "the meshes have more than 65,536 materials together");
  }

  // Transform a copy, and give both meshes the same attributes.
  Mesh added = other;
  if (mesh.positions.empty()) mesh.origin = rounded_centre(transformed_bounds(other, transform));
  transform_positions(added, transform, mesh.origin);
  transform_directions(added, transform);
  if (!mesh.positions.empty()) {
    level_attributes(mesh, added);
  } else {
    mesh.normals.clear();
    mesh.uvs.clear();
    mesh.colours.clear();
  }

  // Append it, with the indices of its vertices and materials moved.
  const std::size_t base = mesh.positions.size();
  if (added.positions.size() > 0xffffffffU - base) {
    throw RequestError(field, "the meshes have 2^32 vertices or more together");
  }
  append_objects(mesh, added);
  const std::size_t material_base = mesh.materials.size();
  mesh.positions.insert(mesh.positions.end(), added.positions.begin(), added.positions.end());
  mesh.normals.insert(mesh.normals.end(), added.normals.begin(), added.normals.end());
  mesh.uvs.insert(mesh.uvs.end(), added.uvs.begin(), added.uvs.end());
  mesh.colours.insert(mesh.colours.end(), added.colours.begin(), added.colours.end());
  for (const auto& triangle : added.triangles) {
    auto& moved = mesh.triangles.emplace_back(triangle);
    for (std::uint32_t& vertex : moved) vertex += static_cast<std::uint32_t>(base);
  }
  for (const std::uint16_t material : added.material_of) {
    mesh.material_of.push_back(static_cast<std::uint16_t>(material_base + material));
  }
  mesh.materials.insert(mesh.materials.end(), added.materials.begin(), added.materials.end());
}

bool is_placement(const Placement& place) {
  for (int column = 0; column < 4; ++column) {
    const glm::dvec3 c = place[column];
    if (!std::isfinite(c.x + c.y + c.z)) return false;
  }
  const double determinant = glm::determinant(glm::dmat3(place));
  return determinant != 0 && std::isfinite(determinant);
}

glm::vec3 turned(const glm::vec3& direction, const Placement& place) {
  const glm::dvec3 moved = glm::dmat3(place) * glm::dvec3(direction);
  const double length = glm::length(moved);
  return length > 0 ? glm::vec3(moved / length) : direction;
}

void place_mesh(Mesh& mesh, const Placement& place) {
  const glm::dmat4 transform(place);
  transform_positions(mesh, transform, rounded_centre(transformed_bounds(mesh, transform)));
  transform_directions(mesh, transform);
}

}  // namespace ptc
