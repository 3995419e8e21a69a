// Reads meshes, materials, cameras and lights from glTF 2.0.
//
//   scene --> node --> node ...            transforms multiply on the way down
//              |  `--> camera, light
//              v
//             mesh --> primitive --> accessors (positions, normals, texture coordinates, indices)
//                          |    or a stream of Draco in their place
//                          `--> material --> texture --> image
//
// GltfDocument follows the arrows and checks each index. GltfPrimitive reads the numbers of a
// primitive, compressed or not. walk_gltf_nodes() walks the nodes of the default scene and notes
// where meshes stand. GltfMesh appends every primitive to one MeshSoup, in which all vertices have
// normals and texture coordinates of the same index: a mesh that stands in two places is there
// twice. Where that would not fit in memory, such a mesh gets a soup of its own, once, and keeps
// its places.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/gltf_materials.h"
#include "engine/io/mesh/gltf_nodes.h"
#include "engine/io/mesh/gltf_primitive.h"
#include "engine/io/mesh/mesh_soup.h"

namespace ptc {
namespace {

using Corner = MeshSoup::Corner;
using Json = GltfDocument::Json;

// An extension that a file may require.
struct Extension {
  std::string_view name;
  bool understood;  // or else it can be left out with little harm, which is told
};
// Pictures in WebP have warnings of their own.
constexpr std::array<Extension, 17> kExtensions = {{{"EXT_mesh_gpu_instancing", true},
                                                    {"EXT_meshopt_compression", true},
                                                    {"KHR_draco_mesh_compression", true},
                                                    {"KHR_materials_emissive_strength", true},
                                                    {"KHR_materials_pbrSpecularGlossiness", true},
                                                    {"KHR_materials_unlit", true},
                                                    {"KHR_materials_clearcoat", false},
                                                    {"KHR_materials_ior", false},
                                                    {"KHR_materials_sheen", false},
                                                    {"KHR_materials_specular", false},
                                                    {"KHR_materials_transmission", false},
                                                    {"KHR_materials_volume", false},
                                                    {"KHR_materials_variants", false},
                                                    {"KHR_mesh_quantization", true},
                                                    {"KHR_texture_transform", true},
                                                    {"KHR_lights_punctual", true},
                                                    {"EXT_texture_webp", true}}};

const Extension* find_extension(std::string_view name) {
  const auto* const found = std::ranges::find(kExtensions, name, &Extension::name);
  return found == kExtensions.end() ? nullptr : found;
}

class GltfMesh {
 public:
  GltfMesh(const std::filesystem::path& path, const MeshRoom& room)
      : document_(path, room.memory_bytes),
        room_(room),
        soup_(path, room_),
        textures_(path, warnings_, room.textures),
        materials_(document_, textures_, warnings_) {
    room_.memory_bytes -= std::min(room_.memory_bytes, document_.json_bytes());
    room_.one_sided = true;  // its materials know their sides
  }

  MeshFile read() {
    check_extensions();
    room_.memory_bytes -= std::min(room_.memory_bytes, document_.view_bytes());
    GltfNodes nodes = walk_gltf_nodes(document_, GltfSearch::all, room_.seconds, room_.part,
                                      room_.memory_bytes, warnings_);
    uses_ = std::move(nodes.uses);
    reserve_decoding();
    std::vector<PlacedMesh> placed;
    if (!copies_fit()) placed = read_placed();
    begin_soup();
    std::optional<std::uint64_t> node;
    for (const GltfUse& use : uses_) {
      if (node != use.node) soup_.begin_object(object_name(use));
      node = use.node;
      add_mesh(use.mesh, glm::dmat4(use.place));
    }
    if (soup_.has_too_many_objects()) warnings_.add(kObjectsLeftOut, "more than 65,536 nodes");
    for (std::size_t i = 0; i < document_.count("skins"); ++i) {
      warnings_.add(kSkinLeftOut, "skin " + std::to_string(i));
    }
    warn_of_extensions();
    MeshFile file;
    if (placed.empty() || !soup_.polygons.empty()) file = end_soup();
    const bool is_empty = file.mesh.triangles.empty() && !file.spilled && placed.empty();
    if (is_empty && room_.part == Motion::any) document_.fail("the mesh has no triangle");
    file.placed = std::move(placed);
    file.cameras = std::move(nodes.cameras);
    file.warnings = warnings_.lines();
    file.lights = std::move(nodes.lights);
    file.moves_mesh = nodes.moves_mesh;
    file.animation_seconds = nodes.animation_seconds;
    return file;
  }

 private:
  // Begins a list of polygons with what is left of the memory.
  void begin_soup() {
    soup_ = MeshSoup(document_.path(), room_);
    materials_.begin_soup();
    has_uvs_ = false;
  }

  // Returns the mesh of the polygons so far.
  MeshFile end_soup() {
    if (!has_uvs_) soup_.drop_uvs();
    return mesh_file(std::move(soup_), {}, {}, true);
  }

  // Returns the name of a node that shows a mesh, else that of the mesh, else its number.
  std::string object_name(const GltfUse& use) {
    for (const Json* const json :
         {&document_.at("nodes", use.node), &document_.at("meshes", use.mesh)}) {
      const auto name = json->find("name");
      if (name != json->end() && name->is_string() && !name->get_ref<const std::string&>().empty())
        return name->get<std::string>();
    }
    return "node " + std::to_string(use.node);
  }

  // Calls a function for each primitive of a mesh that has triangles.
  void for_primitives(std::uint64_t index, const auto& take) {
    const Json& mesh = document_.at("meshes", index);
    const auto primitives = mesh.find("primitives");
    if (primitives == mesh.end() || !primitives->is_array())
      document_.fail("a mesh has no primitives");
    for (const Json& json : *primitives) {
      if (!json.is_object()) document_.fail("a primitive is not an object");
      GltfPrimitive primitive(document_, json);
      if (primitive.has_triangles()) take(json, primitive);
    }
  }

  // Counts the vertices and triangles of a mesh.
  std::pair<std::uint64_t, std::uint64_t> count_mesh(std::uint64_t index) {
    std::uint64_t vertices = 0, triangles = 0;
    for_primitives(index, [&](const Json& /*json*/, const GltfPrimitive& primitive) {
      const std::uint64_t corners = primitive.corners();
      vertices += std::min<std::uint64_t>(primitive.vertices(), MeshSoup::kNone);
      triangles +=
          std::min<std::uint64_t>(primitive.mode() == 4 ? corners / 3 : corners, MeshSoup::kNone);
    });
    return {vertices, triangles};
  }

  // Takes off the memory in which compressed primitives are decoded, one after another.
  void reserve_decoding() {
    std::set<std::uint64_t> meshes;
    for (const GltfUse& use : uses_) meshes.insert(use.mesh);
    std::uint64_t bytes = 0;
    for (const std::uint64_t mesh : meshes) {
      for_primitives(mesh, [&](const Json& /*json*/, const GltfPrimitive& primitive) {
        if (!primitive.is_compressed()) return;
        check_growth(primitive.vertices());  // before the shape is multiplied
        check_growth(primitive.corners() / 3);
        bytes = std::max(bytes, primitive.decode_bytes());
      });
    }
    if (bytes > room_.memory_bytes) {
      throw LimitError(document_.path().string() +
                       ": a Draco-compressed mesh does not fit in `run.memory_bytes`: to decode it "
                       "takes " +
                       std::to_string((bytes >> 20) + 1) + " MiB");
    }
    room_.memory_bytes -= bytes;
  }

  // Says whether a copy of each mesh for each of its places fits in memory, or makes no difference.
  bool copies_fit() {
    std::map<std::uint64_t, std::uint64_t> all;  // uses of a mesh, by its index
    for (const GltfUse& use : uses_) {
      ++all[use.mesh];
      if (is_placement(use.place)) ++times_[use.mesh];
    }
    std::uint64_t vertices = 0, bytes = 0;
    bool repeats = false;
    for (const auto& [mesh, times] : all) {
      const auto [of_vertices, of_triangles] = count_mesh(mesh);
      const std::uint64_t of_bytes = MeshSoup::peak_bytes(of_vertices, of_triangles);
      constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max() / 4;
      if (of_bytes > kMost / times) return false;
      vertices = std::min(kMost, vertices + times * of_vertices);
      bytes = std::min(kMost, bytes + times * of_bytes);
      repeats |= times > 1;
    }
    return !repeats || (bytes <= room_.memory_bytes && vertices <= most_vertices());
  }

  // Reads the meshes that stand in several places, and takes their uses out of the list. Places
  // that flatten a mesh stay in it.
  std::vector<PlacedMesh> read_placed() {
    constexpr std::size_t kMaxSpilled = 32;  // meshes, with a few files each
    std::vector<PlacedMesh> placed;
    std::map<std::uint64_t, std::size_t> index_of;  // in `placed`, of a mesh
    std::set<std::uint64_t> empty;                  // meshes without a triangle
    std::size_t spilled = 0;
    for (const auto& [mesh, times] : times_) {
      if (times == 1 || spilled == kMaxSpilled) continue;
      begin_soup();
      add_mesh(mesh, glm::dmat4(1));
      MeshFile file = end_soup();
      if (file.mesh.triangles.empty() && !file.spilled) {
        empty.insert(mesh);
        continue;
      }
      if (file.spilled) ++spilled;
      index_of[mesh] = placed.size();
      PlacedMesh& made = placed.emplace_back();
      made.places.reserve(times);
      if (file.spilled) {
        made.spilled = std::move(file.spilled);
        continue;
      }
      // What is held is taken off four times, as reading takes four times as much
      room_.memory_bytes -= std::min(room_.memory_bytes, 4 * bytes_of(file.mesh));
      made.mesh = std::make_shared<const Mesh>(std::move(file.mesh));
    }
    std::erase_if(uses_, [&](const GltfUse& use) {
      if (empty.contains(use.mesh)) return true;
      const auto at = index_of.find(use.mesh);
      if (at == index_of.end() || !is_placement(use.place)) return false;
      placed[at->second].places.push_back(use.place);
      return true;
    });
    return placed;
  }

  void check_extensions() const {
    for (std::size_t i = 0; i < document_.count("extensionsRequired"); ++i) {
      const Json& required = document_.root()["extensionsRequired"][i];
      const std::string text = required.is_string() ? required.get<std::string>() : "";
      if (find_extension(text) == nullptr) {
        document_.fail("the extension '" + text + "' is not supported");
      }
    }
  }

  // Tells which extensions a file uses that are not understood.
  void warn_of_extensions() {
    for (std::size_t i = 0; i < document_.count("extensionsUsed"); ++i) {
      const Json& used = document_.root()["extensionsUsed"][i];
      if (!used.is_string()) continue;
      const std::string name = used.get<std::string>();
      const Extension* const known = find_extension(name);
      if (known == nullptr || !known->understood) warnings_.add(kExtensionLeftOut, name);
    }
  }

  // Tells what of a mesh is not read, once.
  void warn_of_mesh(std::uint64_t index) {
    if (!told_.insert(index).second) return;
    const Json& mesh = document_.at("meshes", index);
    if (GltfDocument::has_weights(mesh))
      warnings_.add(kWeightsLeftOut, "mesh " + std::to_string(index));
    for (const Json& json : mesh["primitives"]) {
      if (document_.unsigned_at(json, "mode").value_or(4) < 4)
        warnings_.add(kPrimitiveLeftOut, "mesh " + std::to_string(index));
    }
  }

  void add_mesh(std::uint64_t index, const glm::dmat4& world) {
    for_primitives(index, [&](const Json& json, GltfPrimitive& primitive) {
      const GltfMaterial& material = materials_.use(document_.unsigned_at(json, "material"), soup_);
      const std::uint64_t base = soup_.positions.size();
      check_growth(primitive.vertices());
      primitive.decode();
      add_vertices(primitive, material, world);
      add_triangles(primitive, base, material, mirrors(world));
    });
    warn_of_mesh(index);
  }

  // Appends positions, normals and texture coordinates, as many of each; missing ones are 0.
  void add_vertices(const GltfPrimitive& primitive, const GltfMaterial& material,
                    const glm::dmat4& world) {
    primitive.read("POSITION", 3, [&](std::span<const double> p) {
      soup_.add_position(glm::dvec3(world * glm::dvec4(p[0], p[1], p[2], 1)));
    });
    add_normals(primitive, world);
    soup_.normals.grow(soup_.positions.size(), glm::vec3(0));
    add_uvs(primitive, material);
    soup_.uvs.grow(soup_.positions.size(), glm::vec2(0));
    add_colours(primitive, material);
  }

  // Returns the vertices or corners that the size of the files justifies.
  std::uint64_t most_vertices() const {
    return (std::uint64_t{1} << 20) + 64 * document_.bytes_read();
  }

  // Refuses more than that: accessors without bytes may have any number of elements, and many
  // primitives may share one.
  void check_growth(std::uint64_t more) const {
    const std::uint64_t most = most_vertices();
    if (more > most || soup_.positions.size() > most - more ||
        more >= MeshSoup::kNone - soup_.positions.size() || soup_.corners.size() > most) {
      document_.fail("its meshes repeat vertices to more than this program accepts");
    }
  }

  void add_normals(const GltfPrimitive& primitive, const glm::dmat4& world) {
    if (!primitive.has("NORMAL")) return;
    const glm::dmat3 turn = normal_transform(world);
    primitive.read("NORMAL", 3, [&](std::span<const double> n) {
      soup_.add_normal(glm::vec3(turn * glm::dvec3(n[0], n[1], n[2])));
    });
  }

  void add_uvs(const GltfPrimitive& primitive, const GltfMaterial& material) {
    const std::string key = "TEXCOORD_" + std::to_string(material.place.uv_set);
    if (!primitive.has(key.c_str())) return;
    has_uvs_ = true;
    const double cosine = std::cos(material.place.rotation);
    const double sine = std::sin(material.place.rotation);
    primitive.read(key.c_str(), 2, [&](std::span<const double> uv) {
      const glm::dvec2 scaled = material.place.scale * glm::dvec2(uv[0], uv[1]);
      const double u = material.place.offset.x + cosine * scaled.x + sine * scaled.y;
      const double v = material.place.offset.y - sine * scaled.x + cosine * scaled.y;
      soup_.add_uv({u, 1 - v});  // v of glTF grows downwards
    });
  }

  // Adds the colours of vertices, whose positions are there; alpha is left out.
  void add_colours(const GltfPrimitive& primitive, const GltfMaterial& material) {
    const auto index = primitive.accessor("COLOR_0");
    if (!index) return;
    const Json& accessor = document_.at("accessors", *index);
    if (!primitive.is_compressed("COLOR_0") && !accessor.contains("sparse") &&
        !accessor.contains("bufferView")) {
      warnings_.add(kColoursLeftOut, "accessor " + std::to_string(*index));
      return;
    }
    const bool has_alpha = accessor.contains("type") && accessor["type"] == "VEC4";
    if (has_alpha && material.alpha)
      warnings_.add(kAlphaLeftOut, "accessor " + std::to_string(*index));
    std::uint64_t vertex = soup_.positions.size() - primitive.vertices();
    primitive.read("COLOR_0", has_alpha ? 4 : 3, [&](std::span<const double> c) {
      soup_.add_colour(vertex++, {c[0], c[1], c[2]});
    });
  }

  // Adds the triangles of a list, strip or fan.
  void add_triangles(const GltfPrimitive& primitive, std::uint64_t base,
                     const GltfMaterial& material, bool mirrored) {
    const std::uint64_t mode = primitive.mode();
    std::array<std::uint64_t, 3> last{};  // vertices; the oldest, or the first of a fan, in front
    std::uint64_t seen = 0;
    const auto add = [&](std::uint64_t vertex) {
      const std::uint64_t place = seen++;
      if (place < 3) {
        last[place] = vertex;
      } else if (mode == 4) {
        last[place % 3] = vertex;
      } else {
        last = {mode == 5 ? last[1] : last[0], last[2], vertex};
      }
      if (mode == 4 ? place % 3 != 2 : place < 2) return;
      std::array<std::uint64_t, 3> at = last;
      if (mode == 5 && place % 2 == 1) std::swap(at[0], at[1]);  // every second one of a strip
      if (mirrored) std::swap(at[1], at[2]);
      std::array<Corner, 3> triangle;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto index = static_cast<std::uint32_t>(base + at[k]);
        triangle[k] = {index, index, index};
      }
      soup_.add_polygon(triangle, material.index);
    };
    primitive.read_corners(add);
  }

  GltfDocument document_;
  MeshRoom room_;                 // what is left of it
  MeshSoup soup_;                 // of the meshes that are read together
  std::set<std::uint64_t> told_;  // meshes whose warnings are made
  std::vector<GltfUse> uses_;
  std::map<std::uint64_t, std::uint64_t> times_;  // places of a mesh that can be inverted
  MeshWarnings warnings_;
  TextureLoader textures_;
  GltfMaterials materials_;
  bool has_uvs_ = false;  // some primitive in the soup has texture coordinates
};

// Reads something of a file, whose JSON may hold values of other types than it should.
auto read_checked(const std::filesystem::path& path, const auto& read) {
  try {
    return read();
  } catch (const nlohmann::json::exception& error) {
    throw DataError(path.string() + ": " + error.what());
  }
}

}  // namespace

MeshFile read_gltf_mesh(const std::filesystem::path& path, const MeshRoom& room) {
  return read_checked(path, [&] { return GltfMesh(path, room).read(); });
}

CameraFile read_gltf_cameras(const std::filesystem::path& path, std::optional<double> seconds,
                             std::uint64_t memory_bytes) {
  return read_checked(path, [&] {
    GltfDocument document(path, memory_bytes);
    MeshWarnings warnings;  // read_mesh() tells them
    GltfNodes nodes = walk_gltf_nodes(document, GltfSearch::cameras, seconds, Motion::any,
                                      memory_bytes, warnings);
    return CameraFile{std::move(nodes.cameras), nodes.moves_mesh, nodes.animation_seconds};
  });
}

}  // namespace ptc
