// Triangle meshes with materials, as the sampler of scenes takes them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/io/image/texture.h"

namespace ptc {

/// What lies beyond the border of a texture, along u or v.
enum class Wrap : std::uint8_t {
  repeat,  ///< the texture again
  clamp,   ///< the pixels of its border
  mirror   ///< the texture, and its mirror image by turns
};

/// How a texture goes on beyond its borders.
struct TextureWrap {
  Wrap u = Wrap::repeat, v = Wrap::repeat;

  bool operator==(const TextureWrap&) const = default;
};

/// A material: diffuse reflectance, emission and opacity of a set of triangles.
struct Material {
  std::string name;  ///< as the file has it; may be empty
  /// The mesh file that defines it: materials of one name are one in a file, and may be two in two
  /// files. Empty for those that a mesh in memory or a scene file defines.
  std::string file{};
  glm::vec3 albedo{0.5f};  ///< linear RGB; multiplied by the texture if there is one
  std::shared_ptr<const Texture> texture;  ///< linear RGB, row 0 at the top; may be null
  /// Radiance of the front side, RGB, W / (m^2 sr); multiplied by `emission_texture` if there is
  /// one.
  glm::vec3 emission{0};
  std::shared_ptr<const Texture> emission_texture;  ///< as `texture`
  TextureWrap wrap;                                 ///< of `texture`
  TextureWrap emission_wrap;                        ///< of `emission_texture`
  bool double_sided = false;                        ///< the back reflects as the front does
  /// The share of light that the surface stops, from 0 to 1; multiplied by `opacity_texture` if
  /// there is one. The rest goes straight through.
  float opacity = 1;
  std::shared_ptr<const Texture> opacity_texture;  ///< R = G = B; has the wrap of `texture`
  /// The least opacity where there is a surface, which then stops all light; 0: as `opacity` says.
  float opacity_cutoff = 0;

  /// Says whether the surface stops all light everywhere.
  [[nodiscard]] bool is_opaque() const noexcept { return opacity >= 1 && !opacity_texture; }
};

/// The maximum number of materials of a mesh.
inline constexpr std::size_t kMaxMaterials = 65536;

/// Triangles that follow one another and are of one object: those from `first` on, up to the next
/// run.
struct ObjectRun {
  std::uint32_t first = 0;   ///< index of a triangle
  std::uint32_t object = 0;  ///< index into Mesh::objects

  bool operator==(const ObjectRun&) const = default;
};

/// Triangles with shared vertices. Positions are relative to `origin`, so that coordinates of ten
/// million metres keep millimetres.
struct Mesh {
  glm::dvec3 origin{0};              ///< world coordinates, scene units
  std::vector<glm::vec3> positions;  ///< one per vertex, relative to the origin, scene units
  std::vector<glm::vec3> normals;    ///< one per vertex, unit; empty for flat shading
  /// Texture coordinates, one pair per vertex, or empty. v grows upwards: (0, 0) is the bottom left
  /// corner of the texture, so the row of the image is (1 - v) * height.
  std::vector<glm::vec2> uvs;
  /// Colours by which the albedo is multiplied, linear RGB from 0 to 1, one per vertex; or empty.
  std::vector<glm::vec3> colours;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< counter-clockwise seen from the front
  std::vector<std::uint16_t> material_of;               ///< index into materials, per triangle
  std::vector<Material> materials;                      ///< at least one
  /// Names of the objects that are told apart; empty: all triangles are one object without a name.
  std::vector<std::string> objects{};
  /// By increasing `first`, from triangle 0 on; empty where `objects` is.
  std::vector<ObjectRun> object_runs{};

  /// Returns the box around all vertices in world coordinates.
  [[nodiscard]] Bounds bounds() const;
  /// Returns whether a triangle has a material that emits light.
  [[nodiscard]] bool emits() const;
  /// Returns whether all materials stop all light everywhere.
  [[nodiscard]] bool is_opaque() const;
};

/// Returns the memory of a mesh, bytes, without textures.
[[nodiscard]] std::uint64_t bytes_of(const Mesh& mesh) noexcept;

/// A camera that a mesh file defines.
struct MeshCamera {
  glm::dvec3 position{0};       ///< world coordinates, scene units
  glm::vec3 forward{0, 0, -1};  ///< unit
  glm::vec3 up{0, 1, 0};        ///< unit
  float horizontal_fov = 0.8f;  ///< radians
  /// Width and height of the picture, pixels; 0 where the file does not say.
  std::array<unsigned, 2> size{};
  std::string name{};  ///< as the file has it; of glTF: of its node, else its own; may be empty
};

/// A light that a mesh file defines: one of glTF's KHR_lights_punctual.
struct MeshLight {
  enum class Kind { sun, point, spot } kind = Kind::point;
  glm::dvec3 position{0};          ///< world coordinates; unused by a sun
  glm::vec3 direction{0, 0, -1};   ///< unit; from the light on; unused by a point
  glm::vec3 intensity{1};          ///< linear RGB: lux of a sun, else candela
  float inner_angle = 0;           ///< of a spot: radians, from its axis; at most `outer_angle`
  float outer_angle = 0.7853982f;  ///< of a spot: radians, from its axis; above 0, at most pi / 2
};

class SpilledMesh;

/// Parts of a scene, by whether they ever move.
enum class Motion : std::uint8_t {
  any,    ///< all of it
  still,  ///< what stands in the same place at all times
  moving  ///< the rest
};

/// The memory in which a mesh is read, and where one goes that takes more.
struct MeshRoom {
  /// Cap on the memory while a mesh is read, bytes.
  std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max();
  /// Directory of temporary files for a mesh that takes more.
  std::filesystem::path temp_directory = ".";
  /// Reads the textures; null: they stay in memory.
  std::shared_ptr<TextureStore> textures;
  /// Takes the place of all materials of the mesh, which keep their sides and opacity, and their
  /// names where it has none.
  std::optional<Material> material;
  /// Whether only fronts reflect in formats that say nothing of sides: all but glTF.
  bool one_sided = false;
  /// Time at which the animations of a glTF are shown, finite, seconds; empty: its nodes stand as
  /// the file puts them.
  std::optional<double> seconds{};
  /// Which nodes of a glTF show their meshes and lights. A part may have no triangle.
  Motion part = Motion::any;
};

/// Where a mesh stands: an affine map of its positions to world positions. The first three columns
/// are the linear part, the last one is the translation.
using Placement = glm::dmat4x3;

/// A mesh that stands in several places.
struct PlacedMesh {
  std::shared_ptr<const Mesh> mesh;            ///< null: `spilled`
  std::shared_ptr<const SpilledMesh> spilled;  ///< where the mesh takes more memory than it may
  std::vector<Placement> places;               ///< at least one; each can be inverted
};

/// The content of a mesh file.
struct MeshFile {
  /// All meshes of the file but `placed`, with world transforms applied; may then be empty.
  Mesh mesh;
  /// Meshes that stand in many places, where a copy for each would take more memory than it may.
  std::vector<PlacedMesh> placed;
  /// The mesh in place of `mesh`, where that would take more memory than it may (spilled_mesh.h).
  std::shared_ptr<const SpilledMesh> spilled;
  std::vector<MeshCamera> cameras;  ///< world coordinates
  std::vector<MeshLight> lights;    ///< world coordinates
  /// Whether an animation moves, turns or scales a node at or below which a mesh or a light stands.
  /// If not, meshes and lights are the same at all times, and without one.
  bool moves_mesh = false;
  double animation_seconds = 0;  ///< time of the last key of all animations; 0 without one
  /// The warnings about parts that were left out or replaced: one line for each kind, without the
  /// name of the file.
  std::vector<std::string> warnings;
};

/// Reads a mesh file: OBJ with MTL, PLY, OFF, STL or glTF 2.0 (.gltf, .glb). Positions and
/// transforms are computed in double. PLY, OFF and OBJ may be compressed (.ply.gz), meshes of glTF
/// by Draco.
///
/// The origin is the centre of the bounding box, rounded to integers. Polygons are triangulated,
/// even concave ones. Degenerate triangles and vertices without a triangle are dropped. Every index
/// is checked. If only some triangles have normals, the others get flat ones.
///
/// Objects are the nodes of glTF that show a mesh, and what follows an `o` of OBJ, or a `g` in
/// files without `o`. Files of other formats, files with more than 65,536 objects, and meshes on
/// the disk count as one object.
///
/// Albedo is Kd of MTL and the base colour of glTF, emission Ke and emissiveFactor, all linear,
/// with their textures. A map_Ke without Ke is the emission itself. Opacity is d, or 1 - Tr, and
/// map_d of MTL, by its alpha or else by its grey; in glTF it is the alpha of the base colour where
/// alphaMode is MASK or BLEND. A texture that is missing or
/// damaged causes a warning, and the plain colour takes its place. Colours of vertices multiply it:
/// COLOR_0 of glTF, linear; red, green and blue of PLY and of what follows the coordinates in OBJ,
/// on the sRGB curve. Vertices without a colour are white, and so is a material that is not given
/// where there are colours. Materials of glTF say whether their backs reflect; those of other
/// formats do on both sides unless `room` says otherwise. What a file asks for beyond that (skins,
/// the alpha of vertices, extensions of glTF) is left out and told by a warning; morph targets are
/// left out.
///
/// All animations of a glTF are shown together, as exporters write one for each object. Where two
/// of them move one property of a node, the first one counts. Before its first key and behind its
/// last one a property keeps the value of that key. An animation that breaks a rule is an error
/// when a time is shown, else a warning.
/// @param room  for the mesh; one that takes more memory than that is left on the disk
/// @throws DataError when the file is not a mesh, has no triangle, or has a position that is not
///         finite; LimitError when the JSON of a glTF does not fit in memory; std::system_error
/// @pre    the time that `room` holds, if it does, is finite
/// Memory: about 150 bytes per triangle during the call, but not more than `room` allows.
[[nodiscard]] MeshFile read_mesh(const std::filesystem::path& path, const MeshRoom& room = {});

/// What read_cameras() finds in a mesh file.
struct CameraFile {
  std::vector<MeshCamera> cameras;  ///< world coordinates, in the order of read_mesh()
  bool moves_mesh = false;          ///< as MeshFile
  double animation_seconds = 0;     ///< as MeshFile
};

/// Reads the cameras of a glTF file and nothing of its meshes. Files of other formats have none.
/// @param seconds       time at which animations are shown, as MeshRoom::seconds
/// @param memory_bytes  cap on the memory of the JSON of the file
/// @throws as read_mesh()
[[nodiscard]] CameraFile read_cameras(const std::filesystem::path& path,
                                      std::optional<double> seconds, std::uint64_t memory_bytes);

/// Appends a transformed copy of `other` to `mesh`; both keep their materials and objects. An empty
/// mesh takes its origin from the copy, any other keeps its own. If only one of the two has normals
/// or texture coordinates, the other gets flat normals or (0, 0). A transform that mirrors also
/// reverses the triangles, so that fronts stay fronts.
/// @param transform  affine map of world positions
/// @param field      the member of the request that the meshes come from, for RequestError
/// @throws std::invalid_argument when the transform is not finite and invertible; RequestError when
///         the two have more than 65,536 materials or 2^32 vertices together
void append_mesh(Mesh& mesh, const Mesh& other, const glm::dmat4& transform,
                 const char* field = "inputs");

/// Returns the matrix that transforms normals: the inverse transpose of a transform of positions,
/// up to a positive factor.
[[nodiscard]] glm::dmat3 normal_transform(const glm::dmat4& transform);
/// Says whether a transform mirrors, that is, whether its determinant is negative.
[[nodiscard]] bool mirrors(const glm::dmat4& transform);

/// Returns whether a placement is finite and can be inverted.
[[nodiscard]] bool is_placement(const Placement& place);
/// Returns a unit direction that turns with a place; one that the place makes 0 stays.
[[nodiscard]] glm::vec3 turned(const glm::vec3& direction, const Placement& place);
/// Transforms a mesh in its place, as append_mesh() does with a copy. @pre is_placement(place)
void place_mesh(Mesh& mesh, const Placement& place);

}  // namespace ptc
