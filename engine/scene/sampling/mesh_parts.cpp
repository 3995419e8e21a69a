#include "engine/scene/sampling/mesh_parts.h"

#include <algorithm>
#include <set>
#include <span>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/soup_rules.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = 1 << 12;  // triangles handed on at once

/// Returns a triangle of a mesh by itself.
MeshTriangle triangle_of(const Mesh& mesh, std::size_t index) {
  MeshTriangle triangle{.material = mesh.material_of[index]};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t vertex = mesh.triangles[index][k];
    triangle.positions[k] = mesh.positions[vertex];
    if (!mesh.normals.empty()) triangle.normals[k] = mesh.normals[vertex];
    if (!mesh.uvs.empty()) triangle.uvs[k] = mesh.uvs[vertex];
    if (!mesh.colours.empty()) triangle.colours[k] = mesh.colours[vertex];
  }
  return triangle;
}

/// Returns the box around a mesh in several places: exact unless there are very many vertices, else
/// that of its box in the places.
Bounds bounds_in(const Mesh& mesh, std::span<const Placement> places) {
  constexpr std::size_t kMaxVertices = std::size_t{1} << 27;  // about a second
  Bounds bounds;
  if (mesh.positions.size() > kMaxVertices / places.size()) {
    const Bounds box = mesh.bounds();
    for (const Placement& place : places) bounds.add(placed_bounds(box, place));
    return bounds;
  }
  for (const Placement& place : places) {
    for (const glm::vec3& p : mesh.positions)
      bounds.add(glm::dvec3(place * glm::dvec4(mesh.origin + glm::dvec3(p), 1)));
  }
  return bounds;
}

}  // namespace

Bounds placed_bounds(const Bounds& bounds, const Placement& place) {
  Bounds placed;
  for (int corner = 0; corner < 8 && !bounds.empty(); ++corner) {
    placed.add(place * glm::dvec4(corner & 1 ? bounds.high.x : bounds.low.x,
                                  corner & 2 ? bounds.high.y : bounds.low.y,
                                  corner & 4 ? bounds.high.z : bounds.low.z, 1));
  }
  return placed;
}

void MeshParts::add(Part part, const glm::dvec3& origin, const Bounds& bounds,
                    const std::vector<Material>& materials) {
  const bool again =
      !parts_.empty() && parts_.back().spilled && part.spilled == parts_.back().spilled;
  if (again) {  // its materials are there
    part.first_material = parts_.back().first_material;
    part.material_count = parts_.back().material_count;
    bounds_.add(bounds);
    parts_.push_back(std::move(part));
    return;
  }
  if (materials_.size() + materials.size() > kMaxMaterials)
    throw RequestError("inputs", "the meshes have more than 65,536 materials together");
  if (parts_.empty())
    origin_ = part.place ? glm::round(*part.place * glm::dvec4(origin, 1)) : origin;
  bounds_.add(bounds);
  part.first_material = static_cast<std::uint32_t>(materials_.size());
  part.material_count = static_cast<std::uint32_t>(materials.size());
  materials_.insert(materials_.end(), materials.begin(), materials.end());
  parts_.push_back(std::move(part));
}

void MeshParts::add(std::shared_ptr<const Mesh> mesh, const std::optional<Placement>& place) {
  if (mesh->triangles.empty()) return;
  has_normals_ |= !mesh->normals.empty();
  has_uvs_ |= !mesh->uvs.empty();
  has_colours_ |= !mesh->colours.empty();
  const Mesh& of = *mesh;
  const Bounds bounds = place ? bounds_in(of, {&*place, 1}) : of.bounds();
  add({.mesh = std::move(mesh), .place = place}, of.origin, bounds, of.materials);
}

void MeshParts::add(std::shared_ptr<const SpilledMesh> mesh,
                    const std::optional<Placement>& place) {
  has_normals_ |= mesh->has_normals();
  has_uvs_ |= mesh->has_uvs();
  has_colours_ |= mesh->has_colours();
  const SpilledMesh& of = *mesh;
  const Bounds bounds = place ? placed_bounds(of.bounds(), *place) : of.bounds();
  add({.spilled = std::move(mesh), .place = place}, of.origin(), bounds, of.materials());
}

void MeshParts::add(PlacedMesh mesh) {
  bounds_.add(bounds_in(*mesh.mesh, mesh.places));
  placed_.push_back(std::move(mesh));
}

std::uint64_t texture_bytes(const std::vector<Material>& materials) {
  std::set<const Texture*> textures{nullptr};
  std::set<const TextureStore*> stores{nullptr};
  std::uint64_t bytes = 0;
  for (const Material& material : materials) {
    for (const Texture* texture : {material.texture.get(), material.emission_texture.get(),
                                   material.opacity_texture.get()}) {
      if (!textures.insert(texture).second) continue;
      bytes += texture->bytes();
      if (stores.insert(texture->store()).second) bytes += texture->store()->cache_bytes();
    }
  }
  return bytes;
}

std::uint64_t MeshParts::bytes() const noexcept {
  std::uint64_t bytes = 0;
  std::set<const Mesh*> meshes{nullptr};
  const auto add = [&](const Mesh* mesh) {
    if (meshes.insert(mesh).second) bytes += bytes_of(*mesh);
  };
  for (const Part& part : parts_) add(part.mesh.get());
  for (const PlacedMesh& placed : placed_) {
    add(placed.mesh.get());
    bytes += placed.places.size() * sizeof(Placement);
  }
  return bytes;
}

void MeshParts::visit(const SpilledMesh::Visit& visit) const {
  for (std::size_t i = 0; i < parts_.size(); ++i) this->visit(i, visit);
}

void MeshParts::visit(std::size_t part, const SpilledMesh::Visit& visit) const {
  const Part& of = parts_[part];
  const glm::dvec3 from = of.spilled ? of.spilled->origin() : of.mesh->origin;
  const bool moves = of.place || from != origin_;
  const Placement place = of.place.value_or(Placement(1));
  const glm::dmat3 turn = normal_transform(glm::dmat4(place));
  const bool mirrored = of.place && mirrors(glm::dmat4(place));
  // Puts a triangle in its place, relative to the common origin, and gives it normals and a
  // material
  const auto complete = [&](MeshTriangle& triangle) {
    triangle.material += of.first_material;
    const bool flat = has_normals_ && triangle.normals[0] == glm::vec3(0);
    if (moves) {
      for (glm::vec3& p : triangle.positions)
        p = glm::vec3(place * glm::dvec4(from + glm::dvec3(p), 1) - origin_);
    }
    if (mirrored) {
      std::swap(triangle.positions[1], triangle.positions[2]);
      std::swap(triangle.normals[1], triangle.normals[2]);
      std::swap(triangle.uvs[1], triangle.uvs[2]);
      std::swap(triangle.colours[1], triangle.colours[2]);
    }
    if (flat) {
      const auto& [a, b, c] = triangle.positions;
      triangle.normals.fill(flat_normal(a, b, c));
    } else if (of.place && has_normals_) {
      for (glm::vec3& normal : triangle.normals)
        normal = unit_or_missing(glm::vec3(turn * glm::dvec3(normal)));
    }
  };
  std::vector<MeshTriangle> block;
  if (of.spilled) {
    of.spilled->visit([&](std::span<const MeshTriangle> some) {
      block.assign(some.begin(), some.end());
      for (MeshTriangle& triangle : block) complete(triangle);
      visit(block);
    });
    return;
  }
  for (std::size_t first = 0; first < of.mesh->triangles.size(); first += kBlock) {
    block.clear();
    for (std::size_t i = first; i < std::min(of.mesh->triangles.size(), first + kBlock); ++i)
      complete(block.emplace_back(triangle_of(*of.mesh, i)));
    visit(block);
  }
}

void MeshParts::close(std::size_t part) {
  const Part& of = parts_[part];
  for (std::uint32_t i = 0; i < of.material_count; ++i)
    materials_[of.first_material + i].double_sided = false;
}

}  // namespace ptc
