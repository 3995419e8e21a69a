#include "engine/scene/sampling/mesh_parts.h"

#include <algorithm>
#include <cmath>
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

/// Takes places at equal steps of a sum that is not known beforehand: whenever there are twice as
/// many as wanted, every second one goes, and the step doubles.
class EvenPlaces {
 public:
  explicit EvenPlaces(std::size_t wanted) : wanted_(wanted) {}

  /// Goes on by a weight.
  /// @param place  returns the place of a point that is due; its argument is 0 to 1
  template <typename Place>
  void add(double weight, const Place& place) {
    if (step_ == 0) step_ = weight / static_cast<double>(wanted_);
    for (due_ += weight; due_ > 0 && step_ > 0; due_ -= step_) {
      golden_ = std::fmod(golden_ + 0.618033988749895, 1.0);
      places_.push_back(place(golden_));
      if (places_.size() < 2 * wanted_) continue;
      for (std::size_t i = 0; i < wanted_; ++i) places_[i] = places_[2 * i];
      places_.resize(wanted_);
      step_ *= 2;
    }
  }

  [[nodiscard]] std::vector<glm::dvec3> take() { return std::move(places_); }

 private:
  std::size_t wanted_;
  std::vector<glm::dvec3> places_;
  double step_ = 0, due_ = 0;
  double golden_ = 0;  ///< multiples of the golden ratio spread evenly
};

}  // namespace

void MeshParts::add(Part part, const glm::dvec3& origin, const Bounds& bounds,
                    const std::vector<Material>& materials) {
  if (materials_.size() + materials.size() > kMaxMaterials)
    throw RequestError("inputs", "the meshes have more than 65,536 materials together");
  if (parts_.empty()) origin_ = origin;
  bounds_.add(bounds);
  part.first_material = static_cast<std::uint32_t>(materials_.size());
  materials_.insert(materials_.end(), materials.begin(), materials.end());
  parts_.push_back(std::move(part));
}

void MeshParts::add(Mesh mesh) {
  if (mesh.triangles.empty()) return;
  has_normals_ |= !mesh.normals.empty();
  has_uvs_ |= !mesh.uvs.empty();
  has_colours_ |= !mesh.colours.empty();
  const glm::dvec3 origin = mesh.origin;
  const Bounds bounds = mesh.bounds();
  const std::vector<Material> materials = mesh.materials;
  add({.mesh = std::move(mesh)}, origin, bounds, materials);
}

void MeshParts::add(std::shared_ptr<const SpilledMesh> mesh) {
  has_normals_ |= mesh->has_normals();
  has_uvs_ |= mesh->has_uvs();
  has_colours_ |= mesh->has_colours();
  const SpilledMesh& of = *mesh;
  add({.spilled = std::move(mesh)}, of.origin(), of.bounds(), of.materials());
}

std::uint64_t bytes_of(const Mesh& mesh) noexcept {
  constexpr std::uint64_t kTriangle = sizeof(mesh.triangles[0]) + sizeof(mesh.material_of[0]),
                          kVertex = 2 * sizeof(glm::vec3) + sizeof(glm::vec2);
  return mesh.triangles.size() * kTriangle + mesh.positions.size() * kVertex +
         mesh.colours.size() * sizeof(glm::vec3);
}

std::uint64_t texture_bytes(const std::vector<Material>& materials) {
  std::set<const Texture*> textures{nullptr};
  std::set<const TextureStore*> stores{nullptr};
  std::uint64_t bytes = 0;
  for (const Material& material : materials) {
    for (const Texture* texture : {material.texture.get(), material.emission_texture.get()}) {
      if (!textures.insert(texture).second) continue;
      bytes += texture->bytes();
      if (stores.insert(texture->store()).second) bytes += texture->store()->cache_bytes();
    }
  }
  return bytes;
}

std::uint64_t MeshParts::bytes() const noexcept {
  std::uint64_t bytes = 0;
  for (const Part& part : parts_) bytes += bytes_of(part.mesh);
  return bytes;
}

void MeshParts::visit(const SpilledMesh::Visit& visit) const {
  std::vector<MeshTriangle> block;
  for (const Part& part : parts_) {
    const glm::dvec3 shift = (part.spilled ? part.spilled->origin() : part.mesh.origin) - origin_;
    // Moves triangles to the common origin and gives them normals and materials
    const auto complete = [&](MeshTriangle& triangle) {
      triangle.material += part.first_material;
      const bool flat = has_normals_ && triangle.normals[0] == glm::vec3(0);
      if (flat) {
        const auto& [a, b, c] = triangle.positions;
        triangle.normals.fill(flat_normal(a, b, c));
      }
      if (shift == glm::dvec3(0)) return;
      for (glm::vec3& position : triangle.positions)
        position = glm::vec3(glm::dvec3(position) + shift);
    };
    if (part.spilled) {
      part.spilled->visit([&](std::span<const MeshTriangle> some) {
        block.assign(some.begin(), some.end());
        for (MeshTriangle& triangle : block) complete(triangle);
        visit(block);
      });
      continue;
    }
    for (std::size_t first = 0; first < part.mesh.triangles.size(); first += kBlock) {
      block.clear();
      for (std::size_t i = first; i < std::min(part.mesh.triangles.size(), first + kBlock); ++i)
        complete(block.emplace_back(triangle_of(part.mesh, i)));
      visit(block);
    }
  }
}

SurfaceSurvey survey(const MeshParts& parts, std::size_t places) {
  SurfaceSurvey found;
  EvenPlaces by_area(places), by_count(places);
  parts.visit([&](std::span<const MeshTriangle> triangles) {
    found.triangles += triangles.size();
    for (const MeshTriangle& triangle : triangles) {
      const Material& material = parts.materials()[triangle.material];
      found.emits |= material.emission != glm::vec3(0);
      const glm::dvec3 a(triangle.positions[0]);
      const glm::dvec3 ab = glm::dvec3(triangle.positions[1]) - a,
                       ac = glm::dvec3(triangle.positions[2]) - a;
      const double area = 0.5 * glm::length(glm::cross(ab, ac));
      found.area += area * (material.double_sided ? 2 : 1);
      const auto place = [&](double golden) {
        return parts.origin() + a + std::sqrt(golden) * 0.5 * (ab + ac);
      };
      by_area.add(area, place);
      by_count.add(1, place);
    }
  });
  found.by_area = by_area.take();
  found.by_count = by_count.take();
  return found;
}

}  // namespace ptc
