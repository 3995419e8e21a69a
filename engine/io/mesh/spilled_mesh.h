// A mesh that does not fit in memory: its triangles are on the disk and read one after another.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/io/mesh/mesh.h"

namespace ptc {

class MeshSoup;

/// A triangle with all that a mesh says of it.
struct MeshTriangle {
  std::array<glm::vec3, 3> positions{};  ///< relative to the origin, scene units
  std::array<glm::vec3, 3> normals{};    ///< unit; 0 where the mesh has no normals
  std::array<glm::vec2, 3> uvs{};        ///< as Mesh::uvs; 0 where the mesh has none
  std::array<glm::vec3, 3> colours{glm::vec3(1), glm::vec3(1), glm::vec3(1)};  ///< as Mesh::colours
  std::uint32_t material = 0;  ///< index into the materials
};

/// The triangles of a file in temporary files, as read_mesh() would give them in a Mesh.
/// Memory: kBytes.
class SpilledMesh {
 public:
  /// Memory while triangles are read, bytes.
  static constexpr std::uint64_t kBytes = std::uint64_t{8} << 20;

  /// Checks the mesh and measures it, in two passes.
  /// @throws DataError as read_mesh(); std::system_error
  /// @pre the soup is spilled
  explicit SpilledMesh(MeshSoup soup);
  ~SpilledMesh();
  SpilledMesh(const SpilledMesh&) = delete;
  SpilledMesh& operator=(const SpilledMesh&) = delete;

  [[nodiscard]] const glm::dvec3& origin() const noexcept { return origin_; }
  /// The box around all triangles, world coordinates.
  [[nodiscard]] const Bounds& bounds() const noexcept { return bounds_; }
  [[nodiscard]] const std::vector<Material>& materials() const noexcept;
  [[nodiscard]] std::uint64_t triangles() const noexcept { return triangles_; }
  [[nodiscard]] bool has_normals() const noexcept { return has_normals_; }
  [[nodiscard]] bool has_uvs() const noexcept { return has_uvs_; }
  [[nodiscard]] bool has_colours() const noexcept;

  /// Gets triangles in the order of the file, some at a time.
  using Visit = std::function<void(std::span<const MeshTriangle>)>;
  /// Reads all triangles. @throws std::system_error, and what `visit` throws
  void visit(const Visit& visit) const;

 private:
  std::unique_ptr<MeshSoup> soup_;
  glm::dvec3 origin_{0};
  Bounds bounds_;
  std::uint64_t triangles_ = 0;
  bool has_normals_ = false, has_uvs_ = false;
};

}  // namespace ptc
