// Triangle meshes with materials, as the scene stage takes them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/io/image/image.h"

namespace ptc {

/// Diffuse reflectance and emission of a set of triangles.
struct Material {
  std::string name;
  glm::vec3 albedo{0.5f};                ///< linear; multiplied by the texture when there is one
  std::shared_ptr<const Image> texture;  ///< linear RGB, row 0 at the top; wraps around
  glm::vec3 emission{0};                 ///< radiance on the front side
  bool double_sided = false;             ///< glTF: the back reflects as the front does
};

/// Triangles with shared vertices. Positions are relative to `origin`, so that coordinates of ten
/// million metres keep millimetres.
struct Mesh {
  glm::dvec3 origin{0};
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;  ///< per vertex, unit; or empty: flat shading
  /// Per vertex, or empty. v grows upwards: (0, 0) is the bottom left corner of the texture, so the
  /// row of the image is (1 - v) * height.
  std::vector<glm::vec2> uvs;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< counter-clockwise seen from the front
  std::vector<std::uint16_t> material_of;               ///< per triangle
  std::vector<Material> materials;                      ///< at least one

  [[nodiscard]] Bounds bounds() const;
};

/// A camera found in a mesh file.
struct MeshCamera {
  glm::dvec3 position{0};
  glm::vec3 forward{0, 0, -1};  ///< unit
  glm::vec3 up{0, 1, 0};        ///< unit
  float horizontal_fov = 0.8f;  ///< radians
};

struct MeshFile {
  Mesh mesh;  ///< all meshes of the file, world transforms applied
  std::vector<MeshCamera> cameras;
  /// What was left out or replaced: a line for each kind, without the name of the file.
  std::vector<std::string> warnings;
};

/// Reads OBJ with MTL, PLY, OFF, STL and glTF 2.0 (.gltf, .glb); positions and transforms are kept
/// in double. PLY, OFF and OBJ may be gzipped (.ply.gz).
///
/// The origin is the centre of the bounding box, rounded to integers. Polygons are triangulated,
/// also concave ones; degenerate triangles and vertices without triangle are dropped; every index
/// is checked. Where only some triangles have normals, the others get flat ones.
/// Albedo is Kd of MTL and the base colour of glTF, both linear; a texture that is missing or
/// damaged is a warning, and the plain colour takes its place. Vertex colours, skins and morph
/// targets are left out.
/// @throws DataError when it is no mesh, has no triangle, or a position is not finite;
///         std::system_error
/// Memory: about 150 bytes a triangle while it is read.
[[nodiscard]] MeshFile read_mesh(const std::filesystem::path& path);

/// Appends `other`, transformed, to `mesh`; both keep their materials. An empty mesh takes its
/// origin from what is appended, others keep theirs. Where only one of the two has normals or
/// texture coordinates, the other gets flat normals and (0, 0). A mirroring transform turns the
/// triangles, so that fronts stay fronts.
/// @param transform  affine, of world positions
/// @throws std::invalid_argument when the transform is not finite and invertible; RequestError when
///         both have more than 65,536 materials or 2^32 vertices together
void append_mesh(Mesh& mesh, const Mesh& other, const glm::dmat4& transform);

/// Writes a binary PLY of positions (double) and triangles, for tests and for looking at what was
/// sampled. Published whole or not at all. @throws std::system_error
void write_mesh_ply(const std::filesystem::path& target, const Mesh& mesh);

}  // namespace ptc
