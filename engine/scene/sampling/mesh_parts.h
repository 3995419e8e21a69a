// Meshes in memory and on the disk as one surface that is read triangle by triangle.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"
#include "engine/io/mesh/spilled_mesh.h"

namespace ptc {

/// Returns the memory of a mesh, bytes, without textures.
[[nodiscard]] std::uint64_t bytes_of(const Mesh& mesh) noexcept;
/// Returns the memory of the textures of materials, bytes; what several share counts once.
[[nodiscard]] std::uint64_t texture_bytes(const std::vector<Material>& materials);

/// Meshes that do not fit in memory together.   Threads: const members may be called concurrently.
class MeshParts {
 public:
  /// Adds a mesh behind the others. @throws RequestError when all have more than 65,536 materials
  void add(Mesh mesh);
  void add(std::shared_ptr<const SpilledMesh> mesh);

  /// The origin of the triangles that visit() gives: that of the first mesh.
  [[nodiscard]] const glm::dvec3& origin() const noexcept { return origin_; }
  /// The box around all triangles, world coordinates.
  [[nodiscard]] const Bounds& bounds() const noexcept { return bounds_; }
  [[nodiscard]] const std::vector<Material>& materials() const noexcept { return materials_; }
  [[nodiscard]] bool has_normals() const noexcept { return has_normals_; }
  [[nodiscard]] bool has_uvs() const noexcept { return has_uvs_; }
  [[nodiscard]] bool has_colours() const noexcept { return has_colours_; }
  /// Memory of the meshes in memory, bytes, without textures. While triangles are read there are
  /// SpilledMesh::kBytes more.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

  /// Reads all triangles, with indices into materials(). @throws std::system_error
  void visit(const SpilledMesh::Visit& visit) const;

 private:
  struct Part {
    std::shared_ptr<const SpilledMesh> spilled;  ///< null: `mesh`
    Mesh mesh;
    std::uint32_t first_material = 0;
  };

  void add(Part part, const glm::dvec3& origin, const Bounds& bounds,
           const std::vector<Material>& materials);

  std::vector<Part> parts_;
  glm::dvec3 origin_{0};
  Bounds bounds_;
  std::vector<Material> materials_;
  bool has_normals_ = false, has_uvs_ = false, has_colours_ = false;
};

/// What must be known of a surface before it is sampled.
struct SurfaceSurvey {
  double area = 0;  ///< both sides of double-sided materials count, scene units squared
  std::uint64_t triangles = 0;
  bool emits = false;  ///< a triangle has a material that emits light
  /// Places that are spread evenly, some by area and some by the number of triangles, scene units.
  std::vector<glm::dvec3> by_area, by_count;
};

/// Reads all triangles once.
/// @param places  wanted of each kind, at least; there are fewer than twice as many, unless there
///                are fewer triangles
[[nodiscard]] SurfaceSurvey survey(const MeshParts& parts, std::size_t places);

}  // namespace ptc
