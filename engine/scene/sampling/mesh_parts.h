// Meshes in memory and on the disk as one surface that is read triangle by triangle.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"
#include "engine/io/mesh/spilled_mesh.h"

namespace ptc {

/// Returns the memory of the textures of materials, bytes; what several share counts once.
[[nodiscard]] std::uint64_t texture_bytes(const std::vector<Material>& materials);

/// Meshes that do not fit in memory together.   Threads: const members may be called concurrently.
class MeshParts {
 public:
  /// Adds a mesh behind the others.
  /// @param place  of the mesh; none: its positions are world positions
  /// @throws RequestError when all have more than 65,536 materials
  void add(std::shared_ptr<const Mesh> mesh, const std::optional<Placement>& place = {});
  void add(std::shared_ptr<const SpilledMesh> mesh, const std::optional<Placement>& place = {});
  /// Adds a mesh in memory that stands in several places; visit() does not give its triangles.
  void add(PlacedMesh mesh);

  /// The origin of the triangles that visit() gives: that of the first mesh, where it stands.
  [[nodiscard]] const glm::dvec3& origin() const noexcept { return origin_; }
  /// A box around all triangles, world coordinates.
  [[nodiscard]] const Bounds& bounds() const noexcept { return bounds_; }
  [[nodiscard]] const std::vector<Material>& materials() const noexcept { return materials_; }
  [[nodiscard]] bool has_normals() const noexcept { return has_normals_; }
  [[nodiscard]] bool has_uvs() const noexcept { return has_uvs_; }
  [[nodiscard]] bool has_colours() const noexcept { return has_colours_; }
  [[nodiscard]] const std::vector<PlacedMesh>& placed() const noexcept { return placed_; }
  /// Memory of the meshes in memory and of their places, bytes, without textures. While triangles
  /// are read there are SpilledMesh::kBytes more.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

  /// Returns the number of meshes whose triangles visit() gives.
  [[nodiscard]] std::size_t size() const noexcept { return parts_.size(); }
  /// Reads all triangles, with indices into materials(). @throws std::system_error
  void visit(const SpilledMesh::Visit& visit) const;
  /// Reads the triangles of one mesh. @throws std::system_error
  void visit(std::size_t part, const SpilledMesh::Visit& visit) const;
  /// Makes the materials of a mesh one-sided.
  void close(std::size_t part);

 private:
  struct Part {
    std::shared_ptr<const SpilledMesh> spilled;  ///< null: `mesh`
    std::shared_ptr<const Mesh> mesh;
    std::optional<Placement> place;
    std::uint32_t first_material = 0;
    std::uint32_t material_count = 0;
  };

  void add(Part part, const glm::dvec3& origin, const Bounds& bounds,
           const std::vector<Material>& materials);

  std::vector<Part> parts_;
  std::vector<PlacedMesh> placed_;
  glm::dvec3 origin_{0};
  Bounds bounds_;
  std::vector<Material> materials_;
  bool has_normals_ = false, has_uvs_ = false, has_colours_ = false;
};

/// Returns the box around a box that is placed.
[[nodiscard]] Bounds placed_bounds(const Bounds& bounds, const Placement& place);

}  // namespace ptc
