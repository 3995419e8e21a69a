#include "engine/pipeline/build/meshes.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/surfel.h"
#include "engine/io/file/url.h"
#include "engine/pipeline/point_input.h"
#include "engine/scene/ray_scene.h"

namespace ptc {
namespace {

constexpr std::size_t kBackdropTriangles = 24;  // of its two boxes, the last ones of the mesh

/// Appends a box of 12 triangles whose front sides face outwards.
/// @param low, high  opposite corners, scene units
/// @param field      as for append_mesh()
void add_box(Mesh& mesh, const glm::dvec3& low, const glm::dvec3& high, const Material& material,
             const char* field) {
  Mesh box;
  box.origin = low;
  box.materials.push_back(material);
  box.objects.push_back(material.name);
  box.object_runs.push_back({});
  const glm::vec3 size(high - low);
  for (int corner = 0; corner < 8; ++corner) {
    box.positions.emplace_back(corner & 1 ? size.x : 0, corner & 2 ? size.y : 0,
                               corner & 4 ? size.z : 0);
  }
  constexpr std::uint32_t kQuads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                          {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& q : kQuads) {
    box.triangles.push_back({q[0], q[1], q[2]});
    box.triangles.push_back({q[0], q[2], q[3]});
    box.material_of.insert(box.material_of.end(), 2, 0);
  }
  append_mesh(mesh, box, glm::dmat4(1), field);
}

/// Makes a ground below a box and a red wall to its left.
void add_backdrop(Mesh& mesh, const Bounds& bounds, const char* field) {
  const glm::dvec3 extent = bounds.high - bounds.low;
  const double size = std::max({extent.x, extent.y, extent.z});
  const glm::dvec3 middle = (bounds.low + bounds.high) * 0.5;
  const double floor = bounds.low.y;
  const double wall = bounds.low.x - 0.15 * size;
  add_box(mesh, {middle.x - 1.6 * size, floor - 0.04 * size, middle.z - 1.6 * size},
          {middle.x + 1.6 * size, floor, middle.z + 1.6 * size},
          {.name = "ground", .albedo = glm::vec3(0.6F)}, field);
  add_box(mesh, {wall - 0.05 * size, floor, middle.z - 0.8 * size},
          {wall, floor + 0.9 * size, middle.z + 0.8 * size},
          {.name = "wall", .albedo = glm::vec3(0.65F, 0.07F, 0.05F)}, field);
}

MeshLight placed_at(MeshLight light, const Placement& place) {
  light.position = place * glm::dvec4(light.position, 1);
  light.direction = turned(light.direction, place);
  return light;
}

MeshCamera placed_at(MeshCamera camera, const Placement& place) {
  camera.position = place * glm::dvec4(camera.position, 1);
  camera.forward = turned(camera.forward, place);
  camera.up = turned(camera.up, place);
  return camera;
}

/// Adds the lights or cameras of a file, once for each place of the file.
template <typename Item>
void add_in_places(const std::vector<Item>& items, const std::vector<Placement>& places,
                   std::vector<Item>& all) {
  if (places.empty()) all.insert(all.end(), items.begin(), items.end());
  for (std::size_t i = 0; i < places.size() && !items.empty(); ++i) {
    for (const Item& item : items) all.push_back(placed_at(item, places[i]));
  }
}

/// Says which file the objects and materials of a mesh come from.
void name_parts(Mesh& mesh, const SceneObject& object) {
  const std::string file = file_name(object.file);
  if (mesh.objects.empty() && !mesh.triangles.empty()) {
    mesh.objects.emplace_back();
    mesh.object_runs.push_back({});
  }
  for (std::string& name : mesh.objects) name = name.empty() ? file : file + ":" + name;
  if (object.material && !object.material->name.empty()) return;
  for (Material& material : mesh.materials) material.file = object.file.string();
}

std::optional<double> seconds_of(const std::optional<Moment>& moment) {
  return moment ? std::optional(moment->seconds) : std::nullopt;
}

/// Says whether what is found beside the cameras of a mesh file of a scene is as asked for.
bool any_file(const SceneObjects& scene, std::uint64_t memory_bytes, const auto& is_so) {
  return std::ranges::any_of(scene.objects, [&](const SceneObject& object) {
    return !holds_points(object.file) &&
           std::invoke(is_so, read_cameras(object.file, {}, memory_bytes));
  });
}

/// Says whether a part of an object may show something.
bool has_part(const SceneObject& object, Motion part, std::uint64_t memory_bytes) {
  if (part == Motion::any) return true;
  if (object.moves || part == Motion::still) return object.moves == (part == Motion::moving);
  return read_cameras(object.file, {}, memory_bytes).moves_mesh;
}

/// Collects meshes, and joins them when it is known that all fit.
class Joiner {
 public:
  Joiner(const MeshLimits& limits, const MeshChoice& choice, const char* field)
      : limits_(limits), choice_(choice), field_(field) {}

  /// Returns the room that is left for another mesh. What reading takes at its peak is four times
  /// the mesh, or more.
  [[nodiscard]] MeshRoom room(const SceneObject& object) const {
    const std::uint64_t held = held_ + textures_->bytes();
    const auto left = [&](std::uint64_t cap) { return cap > held ? cap - held : 0; };
    constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
    const std::uint64_t kept = left(limits_.kept);
    return {.memory_bytes = std::min(left(limits_.reading), kept > kMost / 4 ? kMost : 4 * kept),
            .temp_directory = limits_.temp_directory,
            .textures = textures_,
            .material = object.material,
            .one_sided = choice_.one_sided || object.one_sided,
            .seconds = seconds_of(choice_.moment),
            .part = object.moves ? Motion::any : choice_.part};
  }
  [[nodiscard]] TextureStore& textures() noexcept { return *textures_; }

  /// Adds a mesh that stands where its positions say.
  void add(Mesh mesh) {
    if (mesh.objects.empty() && !mesh.triangles.empty()) {
      mesh.objects.emplace_back("mesh");
      mesh.object_runs.push_back({});
    }
    add(std::move(mesh), {}, "the mesh");
  }
  /// Adds the meshes of a file.
  /// @param places  where they stand; none: where their positions say
  void add(MeshFile file, const SceneObject& object) {
    const std::string name = object.file.string();
    name_parts(file.mesh, object);
    add(std::move(file.mesh), object.places, name);
    if (file.spilled) add_apart({nullptr, std::move(file.spilled), object.places}, name);
    for (PlacedMesh& placed : file.placed) {
      if (!object.places.empty()) placed.places = products(object.places, placed.places, name);
      add_apart(std::move(placed), name);
    }
  }

  [[nodiscard]] LoadedMeshes take() {
    if (apart_ || traced_ > limits_.traced) return take_apart();
    LoadedMeshes loaded;
    loaded.traced_bytes = traced_;
    // The first mesh is taken over, so that a single one is never copied
    for (Entry& entry : entries_) {
      const std::vector<Placement>& places = entry.placed.places;
      const std::size_t copies = std::max<std::size_t>(1, places.size());
      const std::size_t first_material = loaded.mesh.materials.size();
      for (std::size_t i = 0; i < copies; ++i) {
        Mesh mesh = i + 1 < copies ? *entry.mesh : std::move(*entry.mesh);
        if (!places.empty()) place_mesh(mesh, places[i]);
        if (i > 0) mesh.materials.clear();  // those of the first copy serve
        if (loaded.mesh.triangles.empty()) {
          loaded.mesh = std::move(mesh);
        } else {
          append(loaded.mesh, mesh, i > 0 ? first_material : loaded.mesh.materials.size());
        }
      }
      entry.mesh.reset();
    }
    const bool moved = entries_.size() == 1 && !entries_[0].placed.places.empty();
    if (moved || entries_.size() > 1) check_mesh(loaded.mesh, field_);  // they may be far apart
    if (choice_.backdrop && !loaded.mesh.triangles.empty())
      add_backdrop(loaded.mesh, loaded.mesh.bounds(), field_);
    return loaded;
  }

 private:
  /// A mesh, and where it stands.
  struct Entry {
    std::shared_ptr<Mesh> mesh;  ///< that can be joined with others; null: `placed` has the mesh
    PlacedMesh placed;
  };

  void add(Mesh mesh, const std::vector<Placement>& places, const std::string& name) {
    if (mesh.triangles.empty()) return;
    check_places(mesh.bounds(), places, name);
    held_ += bytes_of(mesh) + places.size() * sizeof(Placement);
    traced_ += std::max<std::size_t>(1, places.size()) * traced_bytes(mesh);
    entries_.push_back({std::make_shared<Mesh>(std::move(mesh)), {nullptr, nullptr, places}});
  }

  /// Adds a mesh that cannot be joined with others.
  void add_apart(PlacedMesh placed, const std::string& name) {
    check_places(placed.mesh ? placed.mesh->bounds() : placed.spilled->bounds(), placed.places,
                 name);
    apart_ = true;
    held_ += placed.places.size() * sizeof(Placement);
    if (placed.mesh) held_ += bytes_of(*placed.mesh);
    entries_.push_back({nullptr, std::move(placed)});
  }

  /// Checks that a mesh can be traced in all its places.
  static void check_places(const Bounds& bounds, const std::vector<Placement>& places,
                           const std::string& name) {
    constexpr double kMax = 1e18;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Bounds there = placed_bounds(bounds, places[i]);
      const glm::dvec3 size = there.high - there.low;
      if (is_placement(places[i]) && fits_coordinates(there.low) && fits_coordinates(there.high) &&
          std::max({size.x, size.y, size.z}) <= kMax)
        continue;
      throw DataError(name + ": its place " + std::to_string(i) +
                      " is too far away, or makes it too large or too small");
    }
  }

  /// Returns the places of a mesh in a file that stands in several places itself.
  [[nodiscard]] std::vector<Placement> products(const std::vector<Placement>& outer,
                                                const std::vector<Placement>& inner,
                                                const std::string& name) const {
    const std::uint64_t room = limits_.reading > held_ ? limits_.reading - held_ : 0;
    if (inner.size() > room / (3 * sizeof(Placement)) / outer.size()) {
      throw LimitError(
          fmt::format("{}: its {} places, each in {} places, take more memory than "
                      "there is: raise the cap",
                      name, inner.size(), outer.size()));
    }
    std::vector<Placement> all;
    all.reserve(outer.size() * inner.size());
    for (const Placement& o : outer) {
      for (const Placement& i : inner) all.emplace_back(glm::dmat4(o) * glm::dmat4(i));
    }
    return all;
  }

  /// Appends a mesh whose materials begin at an index.
  void append(Mesh& mesh, const Mesh& other, std::size_t first_material) const {
    const std::size_t begin = mesh.material_of.size(), moved = mesh.materials.size();
    append_mesh(mesh, other, glm::dmat4(1), field_);
    if (moved == first_material) return;
    for (std::size_t i = begin; i < mesh.material_of.size(); ++i)
      mesh.material_of[i] =
          static_cast<std::uint16_t>(mesh.material_of[i] - moved + first_material);
  }

  /// Returns the meshes as parts, in the order of the files.
  [[nodiscard]] LoadedMeshes take_apart() {
    LoadedMeshes loaded;
    loaded.parts = std::make_unique<MeshParts>();
    for (Entry& entry : entries_) {
      PlacedMesh& placed = entry.placed;
      if (entry.mesh) placed.mesh = std::move(entry.mesh);
      if (placed.mesh && placed.places.size() > 1) {
        loaded.parts->add(std::move(placed));
        continue;
      }
      const auto add = [&](const std::optional<Placement>& place) {
        if (placed.mesh) {
          loaded.parts->add(placed.mesh, place);
        } else {
          loaded.parts->add(placed.spilled, place);
        }
      };
      for (const Placement& place : placed.places) add(place);
      if (placed.places.empty()) add({});
    }
    if (!choice_.backdrop) return loaded;
    Mesh boxes;
    add_backdrop(boxes, loaded.parts->bounds(), field_);
    loaded.parts->add(std::make_shared<const Mesh>(std::move(boxes)));
    return loaded;
  }

  /// Returns the memory of a mesh with what rays at it and its sampling take.
  [[nodiscard]] static std::uint64_t traced_bytes(const Mesh& mesh) {
    constexpr std::uint64_t kRayBytes = 90, kSamplingBytes = 24;  // for each triangle
    return bytes_of(mesh) + texture_bytes(mesh.materials) +
           mesh.triangles.size() * (kRayBytes + kSamplingBytes);
  }

  MeshLimits limits_;
  MeshChoice choice_;
  std::shared_ptr<TextureStore> textures_ =
      TextureStore::make(limits_.textures, limits_.temp_directory);
  const char* field_;
  std::vector<Entry> entries_;           ///< in the order of the files
  bool apart_ = false;                   ///< there are some that cannot be joined
  std::uint64_t held_ = 0, traced_ = 0;  ///< bytes
};

}  // namespace

LoadedMeshes load_meshes(const std::vector<std::filesystem::path>& inputs, const Mesh* also,
                         const MeshChoice& choice, const MeshLimits& limits, Progress& progress,
                         const char* field) {
  // Read the mesh files
  Joiner joiner(limits, choice, field);
  std::vector<MeshLight> lights;
  const SceneObjects scene =
      read_scene_objects(inputs, &joiner.textures(), limits.reading, choice.moment);
  for (const SceneObject& object : scene.objects) {
    if (holds_points(object.file) || !has_part(object, choice.part, limits.reading)) continue;
    MeshFile file = read_mesh(object.file, joiner.room(object));
    for (const std::string& warning : file.warnings) {
      progress.note(object.file.string() + ": " + warning);
    }
    add_in_places(file.lights, object.places, lights);
    joiner.add(std::move(file), object);
  }

  // Add the mesh in memory and the backdrop
  if (also && choice.part != Motion::moving) {
    check_mesh(*also);
    joiner.add(Mesh(*also));
  }
  LoadedMeshes loaded = joiner.take();
  loaded.lights = std::move(lights);
  return loaded;
}

std::vector<MeshCamera> file_cameras(const std::vector<std::filesystem::path>& files,
                                     const std::optional<Moment>& moment,
                                     std::uint64_t memory_bytes) {
  const SceneObjects scene = read_scene_objects(files, nullptr, memory_bytes, moment);
  std::vector<MeshCamera> cameras;
  for (const SceneCamera& camera : scene.cameras) {
    cameras.push_back(
        mesh_camera(camera.name, moment ? camera.at(moment->frame) : camera.keys.front().second));
  }
  for (const SceneObject& object : scene.objects) {
    if (holds_points(object.file)) continue;
    add_in_places(read_cameras(object.file, seconds_of(moment), memory_bytes).cameras,
                  object.places, cameras);
  }
  return cameras;
}

bool objects_move(const std::vector<std::filesystem::path>& files, std::uint64_t memory_bytes) {
  const SceneObjects scene = read_scene_objects(files, nullptr, memory_bytes);
  return scene.moves || any_file(scene, memory_bytes, &CameraFile::moves_mesh);
}

bool cameras_may_move(const std::vector<std::filesystem::path>& files, std::uint64_t memory_bytes) {
  const SceneObjects scene = read_scene_objects(files, nullptr, memory_bytes);
  const auto has_keys = [](const SceneCamera& camera) { return camera.keys.size() > 1; };
  const auto is_animated = [](const CameraFile& file) { return file.animation_seconds > 0; };
  return scene.moves || std::ranges::any_of(scene.cameras, has_keys) ||
         any_file(scene, memory_bytes, is_animated);
}

Bounds bounds_before_backdrop(const Mesh& mesh) {
  Bounds bounds;
  for (std::size_t i = 0; i + kBackdropTriangles < mesh.triangles.size(); ++i) {
    for (const std::uint32_t vertex : mesh.triangles[i])
      bounds.add(mesh.origin + glm::dvec3(mesh.positions[vertex]));
  }
  return bounds;
}

}  // namespace ptc
