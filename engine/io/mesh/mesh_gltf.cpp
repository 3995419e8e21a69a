// Reads meshes, materials, cameras and lights from glTF 2.0.
//
//   scene --> node --> node ...            transforms multiply on the way down
//              |  `--> camera, light
//              v
//             mesh --> primitive --> accessors (positions, normals, texture coordinates, indices)
//                          `--> material --> texture --> image
//
// GltfDocument follows the arrows and checks each index. GltfMesh walks the nodes of the default
// scene and notes where meshes stand. Then it appends every primitive to one MeshSoup, in which all
// vertices have normals and texture coordinates of the same index: a mesh that stands in two places
// is there twice. Where that would not fit in memory, such a mesh gets a soup of its own, once, and
// keeps its places.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/gltf_materials.h"
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
constexpr std::array<Extension, 15> kExtensions = {{{"EXT_mesh_gpu_instancing", true},
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

constexpr char kLights[] = "KHR_lights_punctual";
constexpr char kInstancing[] = "EXT_mesh_gpu_instancing";

// Returns the matrix of a translation, a rotation (x, y, z, w) and a scale, applied from the last
// to the first.
glm::dmat4 matrix_of(std::span<const double> t, std::span<const double> r,
                     std::span<const double> s) {
  glm::dmat4 matrix = glm::mat4_cast(glm::normalize(glm::dquat(r[3], r[0], r[1], r[2])));
  for (int i = 0; i < 3; ++i) matrix[i] *= s[static_cast<std::size_t>(i)];
  matrix[3] = {t[0], t[1], t[2], 1};
  return matrix;
}

class GltfMesh {
 public:
  GltfMesh(const std::filesystem::path& path, const MeshRoom& room)
      : document_(path, room.memory_bytes),
        room_(room),
        soup_(path, room_),
        textures_(path.parent_path(), warnings_, room.textures),
        materials_(document_, textures_, warnings_) {
    room_.memory_bytes -= std::min(room_.memory_bytes, document_.json_bytes());
    room_.one_sided = true;  // its materials know their sides
  }

  MeshFile read() {
    check_extensions();
    visited_.resize(document_.count("nodes"));
    walk_nodes();
    std::vector<PlacedMesh> placed;
    if (!copies_fit()) placed = read_placed();
    begin_soup();
    for (const auto& [mesh, place] : uses_) add_mesh(mesh, glm::dmat4(place));
    for (std::size_t i = 0; i < document_.count("skins"); ++i) {
      warnings_.add(kSkinLeftOut, "skin " + std::to_string(i));
    }
    warn_of_extensions();
    MeshFile file;
    if (placed.empty() || !soup_.polygons.empty()) file = end_soup();
    if (file.mesh.triangles.empty() && !file.spilled && placed.empty())
      document_.fail("the mesh has no triangle");
    file.placed = std::move(placed);
    file.cameras = std::move(cameras_);
    file.warnings = warnings_.lines();
    file.lights = std::move(lights_);
    return file;
  }

 private:
  // A mesh, by its index, in one place.
  struct Use {
    std::uint64_t mesh;
    Placement place;
  };

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

  // Counts the vertices and triangles of a mesh.
  std::pair<std::uint64_t, std::uint64_t> count_mesh(std::uint64_t index) {
    std::uint64_t vertices = 0, triangles = 0;
    const auto count = [&](std::optional<std::uint64_t> accessor, std::size_t components) {
      return accessor ? document_.find_elements(*accessor, components).count : 0;
    };
    const auto primitives = document_.at("meshes", index).find("primitives");
    if (primitives == document_.at("meshes", index).end() || !primitives->is_array())
      document_.fail("a mesh has no primitives");
    for (const Json& primitive : *primitives) {
      if (!primitive.is_object()) document_.fail("a primitive is not an object");
      const Json* const attributes = GltfDocument::member(primitive, "attributes");
      const std::uint64_t mode = document_.unsigned_at(primitive, "mode").value_or(4);
      if (attributes == nullptr || mode < 4) continue;
      const std::uint64_t of = count(document_.unsigned_at(*attributes, "POSITION"), 3);
      const auto indices = document_.unsigned_at(primitive, "indices");
      const std::uint64_t corners = indices ? count(indices, 1) : of;
      vertices += std::min<std::uint64_t>(of, MeshSoup::kNone);
      triangles += std::min<std::uint64_t>(mode == 4 ? corners / 3 : corners, MeshSoup::kNone);
    }
    return {vertices, triangles};
  }

  // Says whether a copy of each mesh for each of its places fits in memory, or makes no difference.
  bool copies_fit() {
    std::map<std::uint64_t, std::uint64_t> all;  // uses of a mesh, by its index
    for (const Use& use : uses_) {
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
    std::erase_if(uses_, [&](const Use& use) {
      if (empty.contains(use.mesh)) return true;
      const auto at = index_of.find(use.mesh);
      if (at == index_of.end() || !is_placement(use.place)) return false;
      placed[at->second].places.push_back(use.place);
      return true;
    });
    return placed;
  }

  // Notes that a mesh stands in a place.
  void add_use(std::uint64_t mesh, const glm::dmat4& world) {
    uses_.push_back({mesh, Placement(world)});
    constexpr std::size_t kUsesBetweenChecks = 1 << 12;
    if (uses_.size() % kUsesBetweenChecks == 0) check_uses(uses_.size());
  }

  // Checks that so many places fit in memory, twice: here and in what comes of it.
  void check_uses(std::uint64_t count) const {
    if (count <= room_.memory_bytes / (2 * (sizeof(Use) + sizeof(Placement)))) return;
    throw LimitError(document_.path().string() + ": its " + std::to_string(count) +
                     " instances take more memory than there is: raise the cap");
  }

  // Notes the instances of a node. Source: Khronos, EXT_mesh_gpu_instancing.
  void add_instances(std::uint64_t mesh, const Json& instancing, const glm::dmat4& world) {
    const Json* const attributes = GltfDocument::member(instancing, "attributes");
    if (attributes == nullptr) document_.fail("the instances of a node have no attributes");
    std::optional<std::uint64_t> count;
    const auto find = [&](const char* key, std::size_t components) {
      const auto accessor = document_.unsigned_at(*attributes, key);
      if (!accessor) return GltfDocument::Elements{};
      const GltfDocument::Elements found = document_.find_elements(*accessor, components, count);
      count = found.count;
      check_uses(uses_.size() + found.count);
      return found;
    };
    const GltfDocument::Elements translations = find("TRANSLATION", 3);
    const GltfDocument::Elements rotations = find("ROTATION", 4);
    const GltfDocument::Elements scales = find("SCALE", 3);
    if (!count) return add_use(mesh, world);
    struct Parts {
      std::array<double, 3> t{0, 0, 0};
      std::array<double, 4> r{0, 0, 0, 1};
      std::array<double, 3> s{1, 1, 1};
    };
    std::vector<Parts> parts(*count);
    const auto read = [&](const GltfDocument::Elements& from, auto member) {
      if (from.components == 0) return;
      std::size_t at = 0;
      document_.read(from, [&](std::span<const double> numbers) {
        std::ranges::copy(numbers, (parts[at++].*member).begin());
      });
    };
    read(translations, &Parts::t);
    read(rotations, &Parts::r);
    read(scales, &Parts::s);
    for (const Parts& p : parts) add_use(mesh, world * matrix_of(p.t, p.r, p.s));
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

  // Returns the nodes of the default scene or, in a file without scenes, those without a parent.
  std::vector<std::uint64_t> root_nodes() const {
    if (document_.count("scenes") > 0) {
      const std::uint64_t scene = document_.unsigned_at(document_.root(), "scene").value_or(0);
      return node_list(document_.at("scenes", scene), "nodes");
    }
    std::vector<bool> child(document_.count("nodes"));
    for (std::size_t i = 0; i < child.size(); ++i) {
      for (const std::uint64_t c : node_list(document_.at("nodes", i), "children")) {
        if (c < child.size()) child[c] = true;
      }
    }
    std::vector<std::uint64_t> roots;
    for (std::size_t i = 0; i < child.size(); ++i) {
      if (!child[i]) roots.push_back(i);
    }
    return roots;
  }

  std::vector<std::uint64_t> node_list(const Json& object, const char* key) const {
    const auto found = object.find(key);
    if (found == object.end()) return {};
    if (!found->is_array()) document_.fail(std::string(key) + " is not an array");
    std::vector<std::uint64_t> nodes;
    for (const Json& index : *found) {
      if (!index.is_number_unsigned())
        document_.fail(std::string(key) + " holds a value that is not an index");
      nodes.push_back(index.get<std::uint64_t>());
    }
    return nodes;
  }

  // Notes the meshes, cameras and lights of all nodes, parents before their children.
  void walk_nodes() {
    std::vector<std::pair<std::uint64_t, glm::dmat4>> open;
    const auto push = [&](std::vector<std::uint64_t> nodes, const glm::dmat4& parent) {
      std::ranges::reverse(nodes);  // the last one pushed is the next one read
      for (const std::uint64_t node : nodes) open.emplace_back(node, parent);
    };
    push(root_nodes(), glm::dmat4(1));
    while (!open.empty()) {
      const auto [index, parent] = open.back();
      open.pop_back();
      const Json& node = document_.at("nodes", index);
      if (visited_[index]) {
        document_.fail("node " + std::to_string(index) + " has two parents or contains itself");
      }
      visited_[index] = true;
      const glm::dmat4 world = parent * local_transform(node);
      if (const auto mesh = document_.unsigned_at(node, "mesh")) {
        if (const Json* const instancing = GltfDocument::extension(node, kInstancing)) {
          add_instances(*mesh, *instancing, world);
        } else {
          add_use(*mesh, world);
        }
      }
      if (const auto camera = document_.unsigned_at(node, "camera")) add_camera(*camera, world);
      if (const Json* const light = GltfDocument::extension(node, kLights))
        add_light(*light, world);
      push(node_list(node, "children"), world);
    }
  }

  glm::dmat4 local_transform(const Json& node) const {
    if (const auto m = document_.numbers_at<16>(node, "matrix")) {
      glm::dmat4 matrix;
      for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = (*m)[static_cast<std::size_t>(i)];
      return matrix;
    }
    const auto t = document_.numbers_at<3>(node, "translation").value_or(std::array{0.0, 0.0, 0.0});
    const auto r =
        document_.numbers_at<4>(node, "rotation").value_or(std::array{0.0, 0.0, 0.0, 1.0});
    const auto s = document_.numbers_at<3>(node, "scale").value_or(std::array{1.0, 1.0, 1.0});
    return matrix_of(t, r, s);
  }

  void add_mesh(std::uint64_t index, const glm::dmat4& world) {
    const Json& mesh = document_.at("meshes", index);
    const auto primitives = mesh.find("primitives");
    if (primitives == mesh.end() || !primitives->is_array())
      document_.fail("a mesh has no primitives");
    for (const Json& primitive : *primitives) {
      if (!primitive.is_object()) document_.fail("a primitive is not an object");
      add_primitive(primitive, world);
    }
  }

  void add_primitive(const Json& primitive, const glm::dmat4& world) {
    const std::uint64_t mode = document_.unsigned_at(primitive, "mode").value_or(4);
    if (mode < 4) return;  // points and lines
    if (mode > 6) document_.fail("the mode of a primitive is unknown");
    if (GltfDocument::extension(primitive, "KHR_draco_mesh_compression") != nullptr) {
      document_.fail("Draco-compressed meshes are not supported");
    }
    const Json* const attributes = GltfDocument::member(primitive, "attributes");
    const auto position =
        attributes == nullptr ? std::nullopt : document_.unsigned_at(*attributes, "POSITION");
    if (!position) return;
    const GltfMaterial& material =
        materials_.use(document_.unsigned_at(primitive, "material"), soup_);
    const std::uint64_t base = soup_.positions.size();
    const std::uint64_t count = add_vertices(*attributes, *position, material, world);
    add_triangles(primitive, mode, base, count, material, mirrors(world));
  }

  // Appends positions, normals and texture coordinates, as many of each; missing ones are 0.
  std::uint64_t add_vertices(const Json& attributes, std::uint64_t position,
                             const GltfMaterial& material, const glm::dmat4& world) {
    const GltfDocument::Elements positions = document_.find_elements(position, 3);
    check_growth(positions.count);
    document_.read(positions, [&](std::span<const double> p) {
      soup_.add_position(glm::dvec3(world * glm::dvec4(p[0], p[1], p[2], 1)));
    });
    add_normals(attributes, positions.count, world);
    soup_.normals.grow(soup_.positions.size(), glm::vec3(0));
    add_uvs(attributes, positions.count, material);
    soup_.uvs.grow(soup_.positions.size(), glm::vec2(0));
    add_colours(attributes, positions.count);
    return positions.count;
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

  void add_normals(const Json& attributes, std::uint64_t count, const glm::dmat4& world) {
    const auto index = document_.unsigned_at(attributes, "NORMAL");
    if (!index) return;
    const glm::dmat3 turn = normal_transform(world);
    document_.read(document_.find_elements(*index, 3, count), [&](std::span<const double> n) {
      soup_.add_normal(glm::vec3(turn * glm::dvec3(n[0], n[1], n[2])));
    });
  }

  void add_uvs(const Json& attributes, std::uint64_t count, const GltfMaterial& material) {
    const std::string key = "TEXCOORD_" + std::to_string(material.place.uv_set);
    const auto index = document_.unsigned_at(attributes, key.c_str());
    if (!index) return;
    has_uvs_ = true;
    const double cosine = std::cos(material.place.rotation);
    const double sine = std::sin(material.place.rotation);
    document_.read(document_.find_elements(*index, 2, count), [&](std::span<const double> uv) {
      const glm::dvec2 scaled = material.place.scale * glm::dvec2(uv[0], uv[1]);
      const double u = material.place.offset.x + cosine * scaled.x + sine * scaled.y;
      const double v = material.place.offset.y - sine * scaled.x + cosine * scaled.y;
      soup_.add_uv({u, 1 - v});  // v of glTF grows downwards
    });
  }

  // Adds the colours of vertices, whose positions are there; alpha is left out.
  void add_colours(const Json& attributes, std::uint64_t count) {
    const auto index = document_.unsigned_at(attributes, "COLOR_0");
    if (!index) return;
    const Json& accessor = document_.at("accessors", *index);
    if (accessor.contains("sparse") || !accessor.contains("bufferView")) {
      warnings_.add(kColoursLeftOut, "accessor " + std::to_string(*index));
      return;
    }
    const bool has_alpha = accessor.contains("type") && accessor["type"] == "VEC4";
    std::uint64_t vertex = soup_.positions.size() - count;
    document_.read(document_.find_elements(*index, has_alpha ? 4 : 3, count),
                   [&](std::span<const double> c) {
                     soup_.add_colour(vertex++, {c[0], c[1], c[2]});
                   });
  }

  // Adds the triangles of a list, strip or fan.
  void add_triangles(const Json& primitive, std::uint64_t mode, std::uint64_t base,
                     std::uint64_t count, const GltfMaterial& material, bool mirrored) {
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

    // Follow the indices, or count up without them
    const auto accessor = document_.unsigned_at(primitive, "indices");
    if (!accessor) {
      for (std::uint64_t i = 0; i < count; ++i) add(i);
      return;
    }
    document_.read(document_.find_elements(*accessor, 1), [&](std::span<const double> index) {
      if (!(index[0] >= 0 && index[0] < static_cast<double>(count))) {
        document_.fail("an index refers to no vertex");
      }
      add(static_cast<std::uint64_t>(index[0]));
    });
  }

  // Adds a perspective camera, which looks along -z with y up (section 3.10).
  void add_camera(std::uint64_t index, const glm::dmat4& world) {
    const Json* const perspective =
        GltfDocument::member(document_.at("cameras", index), "perspective");
    if (perspective == nullptr) return;
    const double vertical = document_.number_at(*perspective, "yfov", 0.7);
    const double aspect = document_.number_at(*perspective, "aspectRatio", 16.0 / 9);
    const auto camera =
        make_camera(glm::dvec3(world[3]), -glm::dvec3(world[2]), glm::dvec3(world[1]),
                    2 * std::atan(std::tan(vertical / 2) * aspect));
    if (camera) {
      cameras_.push_back(*camera);
    } else if (cameras_left_out_.insert(index).second) {
      warnings_.add(kCameraLeftOut, "camera " + std::to_string(index));
    }
  }

  // Adds a light, which shines along -z. Its range is left out, since light has no end.
  // Source: Khronos, KHR_lights_punctual.
  void add_light(const Json& of_node, const glm::dmat4& world) {
    const Json* const all = GltfDocument::extension(document_.root(), kLights);
    const auto index = document_.unsigned_at(of_node, "light");
    const auto list = all == nullptr ? Json::const_iterator() : all->find("lights");
    if (!index || all == nullptr || list == all->end() || !list->is_array() ||
        *index >= list->size() || !(*list)[*index].is_object()) {
      document_.fail("a node shows a light that does not exist");
    }
    const Json& json = (*list)[*index];
    const auto type = json.find("type");
    MeshLight light{.position = glm::dvec3(world[3])};
    if (type != json.end() && *type == "directional") {
      light.kind = MeshLight::Kind::sun;
    } else if (type != json.end() && *type == "spot") {
      light.kind = MeshLight::Kind::spot;
      set_cone(json, light);
    } else if (type == json.end() || *type != "point") {
      document_.fail("a light is neither directional, point nor spot");
    }
    const auto colour = document_.numbers_at<3>(json, "color").value_or(std::array{1.0, 1.0, 1.0});
    const double intensity = document_.number_at(json, "intensity", 1);
    for (std::size_t i = 0; i < 3; ++i) {
      const double value = colour[i] * intensity;
      light.intensity[static_cast<int>(i)] =
          static_cast<float>(std::clamp<double>(value, 0, std::numeric_limits<float>::max()));
    }
    const glm::dvec3 axis = -glm::dvec3(world[2]);
    const double length = glm::length(axis);
    const bool aims = std::isfinite(length) && length > 0;
    const glm::dvec3& p = light.position;
    if (!std::isfinite(p.x + p.y + p.z) || (!aims && light.kind != MeshLight::Kind::point)) {
      warnings_.add(kLightLeftOut, "light " + std::to_string(*index));
      return;
    }
    if (aims) light.direction = glm::vec3(axis / length);
    lights_.push_back(light);
  }

  void set_cone(const Json& json, MeshLight& light) const {
    const auto spot = json.find("spot");
    if (spot == json.end() || !spot->is_object()) return;
    constexpr double kLeast = 1e-4, kMost = 1.5707963;
    const double outer =
        std::clamp(document_.number_at(*spot, "outerConeAngle", 0.7853981633974483), kLeast, kMost);
    light.outer_angle = static_cast<float>(outer);
    light.inner_angle =
        static_cast<float>(std::clamp(document_.number_at(*spot, "innerConeAngle", 0), 0.0, outer));
  }

  GltfDocument document_;
  MeshRoom room_;  // what is left of it
  MeshSoup soup_;  // of the meshes that are read together
  std::vector<Use> uses_;
  std::map<std::uint64_t, std::uint64_t> times_;  // places of a mesh that can be inverted
  std::vector<MeshCamera> cameras_;
  std::vector<MeshLight> lights_;
  MeshWarnings warnings_;
  TextureLoader textures_;
  GltfMaterials materials_;
  std::set<std::uint64_t> cameras_left_out_;  // indices in the file
  std::vector<bool> visited_;                 // per node
  bool has_uvs_ = false;                      // some primitive in the soup has texture coordinates
};

}  // namespace

MeshFile read_gltf_mesh(const std::filesystem::path& path, const MeshRoom& room) {
  try {
    return GltfMesh(path, room).read();
  } catch (const nlohmann::json::exception& error) {
    throw DataError(path.string() + ": " + error.what());
  }
}

}  // namespace ptc
