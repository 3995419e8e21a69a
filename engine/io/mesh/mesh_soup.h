// Internal to the mesh readers: polygons as files have them, and the mesh that is built from them.
//
//   read_obj_mesh, read_ply_mesh, ...  -->  MeshSoup  -->  build_mesh()  -->  Mesh
//
// A reader only translates its format. build_mesh() does everything that all formats need: it
// checks indices and positions, triangulates polygons, drops degenerate triangles and unused
// vertices, and merges corners of equal position, normal and texture coordinates into vertices.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/file/spool.h"
#include "engine/io/mesh/mesh.h"
#include "engine/io/mesh/mesh_warnings.h"

namespace ptc {

/// Polygons over positions, normals and texture coordinates, each with indices of its own. Readers
/// may add a polygon before its vertices, because indices are checked when all are there. What does
/// not fit in the memory that a MeshRoom allows is on the disk.
class MeshSoup {
 public:
  static constexpr std::uint32_t kNone = 0xffffffff;  ///< index of a corner that lacks something
  /// A corner of a polygon: indices into positions, normals and uvs.
  struct Corner {
    std::uint32_t position = 0;
    std::uint32_t normal = kNone;
    std::uint32_t uv = kNone;
  };

  /// A polygon: some corners, one after another, and a material.
  struct Polygon {
    std::uint32_t corners = 0;   ///< number of them
    std::uint16_t material = 0;  ///< index into materials
  };

  /// @param path  name of the file, for errors
  MeshSoup(std::filesystem::path path, MeshRoom room)
      : path_(std::move(path)), room_(std::move(room)) {}

  Spool<glm::dvec3> positions;  ///< world coordinates, scene units
  Spool<glm::vec3> normals;     ///< of any length; zero and non-finite ones count as missing
  Spool<glm::vec2> uvs;         ///< as Mesh::uvs
  Spool<glm::vec3> colours;     ///< as Mesh::colours, in the order of the positions; may be fewer
  Spool<Corner> corners;        ///< corners of all polygons, one polygon after another
  Spool<Polygon> polygons;
  std::vector<Material> materials;  ///< if empty, settle() adds one of default values

  /// Polygons that follow one another and are of one object.
  struct Run {
    std::uint64_t first = 0;   ///< number of the first polygon
    std::uint32_t object = 0;  ///< index into objects()
  };

  /// Returns the name of the file.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Says whether the lists are on the disk, because the mesh would not fit in memory.
  [[nodiscard]] bool spilled() const noexcept { return positions.spilled(); }
  /// Adds a position, world coordinates.
  /// @throws std::system_error when the lists go to the disk and cannot
  void add_position(const glm::dvec3& position) {
    positions.push_back(position);
    if (positions.size() % kItemsBetweenChecks == 0) check_room();
  }
  /// Adds a normal, of any length. @throws as add_position()
  void add_normal(const glm::vec3& normal) {
    normals.push_back(normal);
    if (normals.size() % kItemsBetweenChecks == 0) check_room();
  }
  /// Adds texture coordinates. @throws as add_position()
  void add_uv(const glm::vec2& uv) {
    uvs.push_back(uv);
    if (uvs.size() % kItemsBetweenChecks == 0) check_room();
  }
  /// Gives a position a colour; those before it that have none become white.
  /// @param position  index, behind those of all colours so far
  /// @param colour    linear RGB; is brought into [0, 1]
  /// @throws as add_position()
  void add_colour(std::uint64_t position, const glm::vec3& colour);
  /// Adds a material and returns its index.
  /// @throws DataError when there are 65,536 materials already
  std::size_t add_material(Material material);
  /// Adds an object, to which the polygons belong that follow, and returns its index. Where there
  /// are too many, or the lists are on the disk, objects are forgotten.
  std::uint32_t begin_object(const std::string& name);
  /// Goes on with an object that was begun.
  void resume_object(std::uint32_t object);
  [[nodiscard]] const std::vector<std::string>& objects() const noexcept { return objects_; }
  [[nodiscard]] const std::vector<Run>& object_runs() const noexcept { return runs_; }
  /// Says whether objects are forgotten because there are too many of them.
  [[nodiscard]] bool has_too_many_objects() const noexcept { return too_many_objects_; }
  /// Adds a polygon with an index of a material.
  /// @throws as add_position()
  void add_polygon(std::span<const Corner> polygon, std::size_t material);
  /// Removes all texture coordinates. It is for readers that gave every corner an index before they
  /// knew that the file has no coordinates.
  void drop_uvs();
  /// Returns a corner as readers gave it, but for what drop_uvs() removed.
  /// @param polygon  number of its polygon, for the error
  /// @throws DataError when one of its indices is out of range
  [[nodiscard]] Corner checked(Corner corner, std::uint64_t polygon) const;
  /// Ends the lists: leaves them in memory or on the disk, and completes the materials, as MeshRoom
  /// describes.
  void settle();
  /// Returns the memory that build_mesh() takes at its peak for triangles whose vertices have all
  /// attributes, bytes.
  [[nodiscard]] static std::uint64_t peak_bytes(std::uint64_t vertices,
                                                std::uint64_t triangles) noexcept {
    return vertices * (56 + 40 + 24 + 24) + triangles * (3 * 12 + 94 + 8);
  }
  /// Returns the memory that build_mesh() takes at its peak, bytes.
  [[nodiscard]] std::uint64_t peak_bytes() const noexcept;

 private:
  static constexpr std::uint64_t kItemsBetweenChecks = 1 << 12;
  void check_room();

  std::filesystem::path path_;
  MeshRoom room_;
  void forget_objects();

  bool uvs_dropped_ = false;
  std::vector<std::string> objects_;
  std::vector<Run> runs_;
  std::uint64_t object_bytes_ = 0;  ///< memory of the names
  bool too_many_objects_ = false;
  std::uint64_t triangles_ = 0;  ///< that the polygons become, at most
};

/// Builds the mesh of a soup: triangles over shared vertices, relative to an origin.
/// @throws DataError when an index is out of range, or a position is not finite or too far from the
///         others
/// @pre  the soup is not spilled
[[nodiscard]] Mesh build_mesh(MeshSoup soup);
/// Makes the content of a file: a mesh in memory or, of a soup that is spilled, one on the disk.
/// @param may_be_empty  whether there need not be a triangle
/// @throws as build_mesh(), and DataError when no triangle is left
[[nodiscard]] MeshFile mesh_file(MeshSoup soup, std::vector<MeshCamera> cameras,
                                 std::vector<std::string> warnings, bool may_be_empty = false);

/// The work that the triangulation of a polygon took.
struct TriangulationCounts {
  std::uint64_t looks = 0;      ///< corners, and boxes around corners, that were examined
  std::size_t fan_corners = 0;  ///< corners of the part that became a fan; 0 for a simple polygon
};

/// Splits a simple polygon into triangles that keep its winding, and appends them as indices of its
/// corners. Ears are cut off one after another; a rest without an ear, which only polygons that
/// intersect themselves leave, becomes a fan.
///
/// For n corners the work is about n log n looks. It is up to n sqrt(n) when long triangles lie
/// among evenly spread corners.
/// @param max_looks  number of looks after which the rest becomes a fan; the default is the smaller
///                   of n (1024 + 8 sqrt(n)) and 2^34
TriangulationCounts triangulate(std::span<const glm::dvec3> polygon,
                                std::vector<std::array<std::uint32_t, 3>>& triangles,
                                std::optional<std::uint64_t> max_looks = {});

/// Makes a camera from directions of any length.
/// @param horizontal_fov  radians
/// @return nothing when a value is not finite, a direction is zero, or the field of view is not
///         positive
[[nodiscard]] std::optional<MeshCamera> make_camera(const glm::dvec3& position,
                                                    const glm::dvec3& forward, const glm::dvec3& up,
                                                    double horizontal_fov);

/// Returns the reason why a file that a mesh names could not be read, for a warning: "NAME:
/// REASON".
/// @param name  name of the file as the mesh has it
/// @param path  path under which it was opened; it is removed from the front of the error's text
[[nodiscard]] std::string reason_for(const std::string& name, const std::filesystem::path& path,
                                     const std::exception& error);

/// What a texture is loaded for.
enum class TextureUse : std::uint8_t {
  colour,
  /// How opaque its pixels are, as TextureStore::read_opacity() says.
  alpha,
  alpha_or_grey
};

/// Loads the textures of a mesh, each file once. A texture that cannot be loaded becomes a
/// warning and a null pointer.
///
/// All textures of a mesh together may have `free_pixels` pixels plus 256 for each byte of the
/// files that hold them; a texture beyond that fails. So a small file cannot ask for much memory.
/// Photographs have fewer than 100 pixels per byte; only pictures of a single colour have more.
class TextureLoader {
 public:
  /// Makes a loader for one mesh.
  /// @param mesh       the file, to whose folder names of textures are relative
  /// @param warnings   receives the failures; must outlive this loader
  /// @param store      reads the textures; null: they stay in memory
  TextureLoader(std::filesystem::path mesh, MeshWarnings& warnings,
                std::shared_ptr<TextureStore> store, std::uint64_t free_pixels = kMaxImagePixels)
      : mesh_(std::move(mesh)),
        warnings_(warnings),
        store_(store ? std::move(store) : TextureStore::make()),
        free_pixels_(free_pixels) {}

  /// Returns the texture in a file; null after a warning, or for the opacity of an opaque one.
  /// @param name  path relative to the folder of the mesh, with / or \ between its parts
  /// @throws LimitError when the texture takes more memory to decode than it may
  [[nodiscard]] std::shared_ptr<const Texture> load(const std::string& name,
                                                    TextureUse use = TextureUse::colour);
  /// Decodes a texture in bytes of the mesh's own files, or returns null after a warning. Unlike
  /// load(), each call makes a texture of its own.
  /// @param name        name of the texture, for the warning
  /// @param mesh_bytes  size of these files as far as they were read, bytes
  /// @throws as load()
  [[nodiscard]] std::shared_ptr<const Texture> decode(const std::string& name,
                                                      const ByteRange& bytes,
                                                      std::uint64_t mesh_bytes,
                                                      TextureUse use = TextureUse::colour);

 private:
  /// Returns the number of pixels that the next texture may have.
  [[nodiscard]] std::uint64_t pixels_left() const;
  /// Reads a texture, counts its pixels and puts it on the heap.
  std::shared_ptr<const Texture> read(const ByteRange& bytes, const std::string& name,
                                      TextureUse use);

  std::filesystem::path mesh_;
  MeshWarnings& warnings_;
  std::shared_ptr<TextureStore> store_;
  std::uint64_t free_pixels_;
  std::uint64_t pixels_ = 0;         // of all textures so far
  std::uint64_t texture_bytes_ = 0;  // size of the files that load() read
  std::uint64_t mesh_bytes_ = 0;     // size of the mesh's own files
  std::map<std::pair<std::string, TextureUse>, std::shared_ptr<const Texture>> loaded_;
  std::set<std::string> failed_;  // paths that a warning has told
};

// The readers of each format, as read_mesh() describes them.

[[nodiscard]] MeshFile read_ply_mesh(const std::filesystem::path& path, const MeshRoom& room);
[[nodiscard]] MeshFile read_off_mesh(const std::filesystem::path& path, const MeshRoom& room);
[[nodiscard]] MeshFile read_obj_mesh(const std::filesystem::path& path, const MeshRoom& room);
[[nodiscard]] MeshFile read_gltf_mesh(const std::filesystem::path& path, const MeshRoom& room);
[[nodiscard]] MeshFile read_stl_mesh(const std::filesystem::path& path, const MeshRoom& room);

/// Reads the cameras of a glTF, as read_cameras() describes it.
[[nodiscard]] CameraFile read_gltf_cameras(const std::filesystem::path& path,
                                           std::optional<double> seconds,
                                           std::uint64_t memory_bytes);

}  // namespace ptc
