#include "engine/pipeline/build/meshes.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include "engine/base/surfel.h"
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

/// Collects meshes, and joins them when it is known that all fit.
class Joiner {
 public:
  Joiner(const MeshLimits& limits, const char* field) : limits_(limits), field_(field) {}

  /// Returns the room that is left for another mesh. What reading takes at its peak is four times
  /// the mesh, or more.
  [[nodiscard]] MeshRoom room() const {
    const std::uint64_t held = held_ + textures_->bytes();
    const auto left = [&](std::uint64_t cap) { return cap > held ? cap - held : 0; };
    constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
    const std::uint64_t kept = left(limits_.kept);
    return {std::min(left(limits_.reading), kept > kMost / 4 ? kMost : 4 * kept),
            limits_.temp_directory, textures_};
  }

  void add(Mesh mesh) {
    held_ += bytes_of(mesh);
    traced_ += traced_bytes(mesh);
    meshes_.push_back({std::move(mesh), nullptr});
  }
  void add(std::shared_ptr<const SpilledMesh> mesh) {
    spilled_ = true;
    meshes_.push_back({{}, std::move(mesh)});
  }

  [[nodiscard]] LoadedMeshes take(bool backdrop) {
    LoadedMeshes loaded;
    if (spilled_ || traced_ > limits_.traced) {
      loaded.parts = std::make_unique<MeshParts>();
      for (auto& [mesh, spilled] : meshes_) {
        if (spilled) {
          loaded.parts->add(std::move(spilled));
        } else {
          loaded.parts->add(std::move(mesh));
        }
      }
      if (!backdrop) return loaded;
      Mesh boxes;
      add_backdrop(boxes, loaded.parts->bounds(), field_);
      loaded.parts->add(std::move(boxes));
      return loaded;
    }
    // The first mesh is taken over, so that a single one is never copied
    for (auto& [mesh, spilled] : meshes_) {
      if (loaded.mesh.triangles.empty()) {
        loaded.mesh = std::move(mesh);
      } else {
        append_mesh(loaded.mesh, std::exchange(mesh, {}), glm::dmat4(1), field_);
      }
    }
    if (meshes_.size() > 1) check_mesh(loaded.mesh, field_);  // they may lie too far apart
    if (backdrop && !loaded.mesh.triangles.empty())
      add_backdrop(loaded.mesh, loaded.mesh.bounds(), field_);
    return loaded;
  }

 private:
  /// Returns the memory of a mesh with what rays at it and its sampling take.
  [[nodiscard]] static std::uint64_t traced_bytes(const Mesh& mesh) {
    constexpr std::uint64_t kRayBytes = 90, kSamplingBytes = 24;  // for each triangle
    return bytes_of(mesh) + texture_bytes(mesh.materials) +
           mesh.triangles.size() * (kRayBytes + kSamplingBytes);
  }

  MeshLimits limits_;
  std::shared_ptr<TextureStore> textures_ =
      TextureStore::make(limits_.textures, limits_.temp_directory);
  const char* field_;
  std::vector<std::pair<Mesh, std::shared_ptr<const SpilledMesh>>> meshes_;
  bool spilled_ = false;
  std::uint64_t held_ = 0, traced_ = 0;  ///< bytes
};

}  // namespace

LoadedMeshes load_meshes(const std::vector<std::filesystem::path>& inputs, const Mesh* also,
                         bool backdrop, const MeshLimits& limits, Progress& progress,
                         std::vector<MeshCamera>* cameras, const char* field) {
  // Read the mesh files
  Joiner joiner(limits, field);
  std::vector<MeshLight> lights;
  for (const std::filesystem::path& input : inputs) {
    if (holds_points(input)) continue;
    MeshFile file = read_mesh(input, joiner.room());
    for (const std::string& warning : file.warnings) {
      progress.note(input.string() + ": " + warning);
    }
    lights.insert(lights.end(), file.lights.begin(), file.lights.end());
    if (cameras) cameras->insert(cameras->end(), file.cameras.begin(), file.cameras.end());
    if (file.spilled) {
      joiner.add(std::move(file.spilled));
    } else {
      joiner.add(std::move(file.mesh));
    }
  }

  // Add the mesh in memory and the backdrop
  if (also) {
    check_mesh(*also);
    joiner.add(Mesh(*also));
  }
  LoadedMeshes loaded = joiner.take(backdrop);
  loaded.lights = std::move(lights);
  return loaded;
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
