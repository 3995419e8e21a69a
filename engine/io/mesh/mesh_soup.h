// Inside the mesh readers: polygons as files have them, and the mesh that is made of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"
#include "engine/io/mesh/mesh_warnings.h"

namespace ptc {

/// Polygons over positions, normals and texture coordinates that are indexed each on its own.
/// Readers fill it; indices may run ahead of the vertices, build_mesh() checks them.
struct MeshSoup {
  static constexpr std::uint32_t kNone = 0xffffffff;
  struct Corner {
    std::uint32_t position = 0;
    std::uint32_t normal = kNone;
    std::uint32_t uv = kNone;
  };

  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;  ///< any length; zero and non-finite ones count as missing
  std::vector<glm::vec2> uvs;
  std::vector<Corner> corners;               ///< of all polygons, one after another
  std::vector<std::uint32_t> polygon_sizes;  ///< corners of each
  std::vector<std::uint16_t> material_of;    ///< per polygon
  std::vector<Material> materials;           ///< empty: one of default values is used

  /// @throws DataError when there are 65,536 already
  std::size_t add_material(Material material, const std::filesystem::path& path);
  /// @throws DataError when there are 2^28 corners already
  void add_polygon(std::span<const Corner> polygon, std::size_t material,
                   const std::filesystem::path& path);
  /// For readers that gave every corner coordinates and then found that the file has none.
  void drop_uvs();
};

/// @throws DataError when an index leads nowhere, a position is not finite or too far from the
///         others, or no triangle is left
[[nodiscard]] Mesh build_mesh(MeshSoup soup, const std::filesystem::path& path);

/// What it took to triangulate a polygon.
struct TriangulationCounts {
  std::uint64_t looks = 0;      ///< at corners and at boxes around them
  std::size_t fan_corners = 0;  ///< of what became a fan; 0 for a simple polygon
};

/// Splits a simple polygon into triangles of its corners' numbers, in its winding. Concave polygons
/// are cut by ears; what no ear can be cut from (self-intersections) becomes a fan.
///
/// The work is about n log n looks for n corners; where long triangles lie among evenly spread
/// corners it is up to n sqrt(n).
/// @param max_looks  after which the rest becomes a fan; usually n (1024 + 8 sqrt(n)) or 2^34
TriangulationCounts triangulate(std::span<const glm::dvec3> polygon,
                                std::vector<std::array<std::uint32_t, 3>>& triangles,
                                std::optional<std::uint64_t> max_looks = {});

/// Takes normals through a transform: its inverse transpose, up to a positive factor.
[[nodiscard]] glm::dmat3 normal_transform(const glm::dmat4& transform);
[[nodiscard]] bool mirrors(const glm::dmat4& transform);

/// Directions of any length. @return nothing when a value is not finite or has no direction
[[nodiscard]] std::optional<MeshCamera> make_camera(const glm::dvec3& position,
                                                    const glm::dvec3& forward, const glm::dvec3& up,
                                                    double horizontal_fov);

/// Why a file that a mesh names could not be read, for a warning: "NAME: REASON".
/// @param name  as the mesh has it
/// @param path  under which it was opened; an error that begins with it says so once
[[nodiscard]] std::string reason_for(const std::string& name, const std::filesystem::path& path,
                                     const std::exception& error);

/// Loads each texture once; a failure becomes a warning and no texture.
///
/// All textures of a mesh have at most `free_pixels` and 256 for each byte of the files that they
/// are in, and one beyond that fails: a small file cannot ask for much memory. Photographs have
/// less than 100 pixels a byte, only pictures of a single colour have more.
class TextureLoader {
 public:
  TextureLoader(std::filesystem::path directory, MeshWarnings& warnings,
                std::uint64_t free_pixels = kMaxImagePixels)
      : directory_(std::move(directory)), warnings_(warnings), free_pixels_(free_pixels) {}

  /// @param name  path relative to the directory, / or \ between its parts
  [[nodiscard]] std::shared_ptr<const Image> load(const std::string& name);
  /// A picture inside the mesh's own files, known as `name` from now on.
  /// @param mesh_bytes  of these files, as far as they were read
  [[nodiscard]] std::shared_ptr<const Image> decode(const std::string& name,
                                                    std::span<const std::byte> bytes,
                                                    std::uint64_t mesh_bytes);

 private:
  [[nodiscard]] std::uint64_t pixels_left() const;
  std::shared_ptr<const Image> keep(Image image);

  std::filesystem::path directory_;
  MeshWarnings& warnings_;
  std::uint64_t free_pixels_;
  std::uint64_t pixels_ = 0;
  std::uint64_t texture_bytes_ = 0;  // of the files that load() read
  std::uint64_t mesh_bytes_ = 0;
  std::map<std::string, std::shared_ptr<const Image>> loaded_;
};

[[nodiscard]] MeshFile read_ply_mesh(const std::filesystem::path& path);
[[nodiscard]] MeshFile read_off_mesh(const std::filesystem::path& path);
[[nodiscard]] MeshFile read_obj_mesh(const std::filesystem::path& path);
[[nodiscard]] MeshFile read_gltf_mesh(const std::filesystem::path& path);
[[nodiscard]] MeshFile read_stl_mesh(const std::filesystem::path& path);

}  // namespace ptc
